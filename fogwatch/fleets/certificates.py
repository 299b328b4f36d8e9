"""Certificates of a fleet, made and checked with the command ``openssl``, which nearly every Linux has."""

from __future__ import annotations

import ipaddress
import os
import shutil
import ssl
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from patrol.errors import BadInput
from patrol.files.untrusted import CERTIFICATE as KIND
from patrol.files.untrusted import open_untrusted
from runtime.security.credentials import AUTHORITY, CERTIFICATE, KEY

AUTHORITY_DAYS = 3650
"""Validity of a fleet's authority, in days."""
_DAY_S = 86400
_CURVE = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes")
_UNKNOWN_NAME = "?"


@dataclass(frozen=True, slots=True)
class Facts:
    """A certificate's holder, and when it expires."""

    common_name: str  # of the holder
    ends_s: int  # when it expires, Unix time


def make_authority(folder: Path, fleet: str) -> None:
    """Make a fleet's authority, which signs the certificates of its members, in a new folder.

    Its key must stay there.
    """
    folder.mkdir(mode=0o700)
    subject = ("-subj", f"/O=fogwatch/CN={fleet[:50]} authority")
    extensions = ("-addext", "basicConstraints=critical,CA:TRUE,pathlen:0", "-addext", "keyUsage=critical,keyCertSign")
    files = ("-keyout", str(folder / KEY), "-out", str(folder / CERTIFICATE))
    _run_openssl("req", "-x509", *_CURVE, *subject, *extensions, *files, "-days", str(AUTHORITY_DAYS))


def issue(
    authority: Path, folder: Path, common_name: str, days: int, hosts: Sequence[str] = (), *, listens: bool = False
) -> None:
    """Issue a certificate with a new key, into a folder that gets the authority's certificate as well.

    `days` is cut to the rest of the authority's validity, beyond which a certificate would not be accepted. `hosts` are
    names and addresses of a router, which may also connect to another one; without any, the holder is a member, which
    cannot pass for a router. `listens` is for a member of a fleet without router: others connect to it, too, whatever
    its address.
    """
    _check_regular(authority / KEY)
    valid_days = int(facts(authority / CERTIFICATE).ends_s - time.time()) // _DAY_S
    if valid_days < 1:
        raise BadInput(f"{authority}: the authority has expired, or does so within a day; make a new fleet")
    names = ",".join(f"{'IP' if _is_address(host) else 'DNS'}:{host}" for host in hosts)
    usage = "serverAuth,clientAuth" if hosts or listens else "clientAuth"
    extensions = f"basicConstraints=critical,CA:FALSE\nkeyUsage=critical,digitalSignature\nextendedKeyUsage={usage}\n"
    if hosts:
        extensions += f"subjectAltName=critical,{names}\n"
    with tempfile.TemporaryDirectory(prefix=".new-", dir=folder) as temporary:
        work = Path(temporary)
        wish, extension_file = work / "wish.pem", work / "extensions"
        extension_file.write_text(extensions, encoding="ascii")
        subject = ("-subj", f"/O=fogwatch/CN={common_name}")
        _run_openssl("req", "-new", *_CURVE, *subject, "-keyout", str(work / KEY), "-out", str(wish))
        signed = ("-CA", str(authority / CERTIFICATE), "-CAkey", str(authority / KEY), "-extfile", str(extension_file))
        serial = ("-set_serial", f"0x{os.urandom(16).hex()}")
        output = ("-out", str(work / CERTIFICATE), "-days", str(min(days, valid_days)))
        _run_openssl("x509", "-req", "-in", str(wish), *signed, *serial, *output)
        shutil.copyfile(authority / CERTIFICATE, work / AUTHORITY)
        for name in (KEY, CERTIFICATE, AUTHORITY):  # all that can fail has been done: no key without its certificate
            (work / name).replace(folder / name)


def facts(certificate: Path) -> Facts:
    """Read the holder and the end of a certificate."""
    _check_regular(certificate)
    text = _run_openssl("x509", "-noout", "-enddate", "-subject", "-nameopt", "multiline", "-in", str(certificate))
    fields = {name.strip(): value.strip() for name, _, value in (line.partition("=") for line in text.splitlines())}
    return Facts(fields.get("commonName", _UNKNOWN_NAME), ssl.cert_time_to_seconds(fields["notAfter"]))


def problem(folder: Path, authority: Path) -> str:
    """Return what is wrong with a certificate, empty if nothing; when it expires does not matter here.

    `folder` holds the certificate and its key; `authority` is the certificate of the fleet's authority.
    """
    for file in (authority, folder / CERTIFICATE, folder / KEY):
        _check_regular(file)
    certificate, key = str(folder / CERTIFICATE), str(folder / KEY)
    try:
        _run_openssl("verify", "-no_check_time", "-CAfile", str(authority), certificate)
    except BadInput:
        return "is not signed by the fleet's authority"
    if _run_openssl("x509", "-noout", "-pubkey", "-in", certificate) != _run_openssl("pkey", "-pubout", "-in", key):
        return "does not belong to the key beside it"
    return ""


def _is_address(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


def _check_regular(file: Path) -> None:
    """Check that openssl comes to the end of a file: it would wait for a named pipe, and read a device for ever."""
    try:
        open_untrusted(file, KIND).close()
    except OSError as error:
        raise BadInput(f"{file} cannot be read: {error.strerror}; restore it") from None


def _run_openssl(*words: str) -> str:
    """Run openssl; return what it prints. No secret is among its words, and only this user can read its files."""
    try:
        process = subprocess.run(["openssl", *words], capture_output=True, text=True, check=False, umask=0o077)
    except FileNotFoundError:
        remedy = "install it (on Debian or Ubuntu: apt install openssl)"
        raise BadInput(f"the command openssl is missing; {remedy}") from None
    if process.returncode != 0:
        lines = [line for line in process.stderr.splitlines() if line.strip()]
        raise BadInput(f"openssl {words[0]} failed: {lines[-1].strip() if lines else process.returncode}")
    return process.stdout
