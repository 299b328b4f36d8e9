import json
import logging
import sys
import threading
import warnings
from collections.abc import Iterator
from typing import Any

import pytest

from runtime.process.failures import CRASHED
from runtime.process.lifeline import run_process
from runtime.reporting import logs
from runtime.reporting.logs import LONGEST, Format, Log, begin_log


@pytest.fixture(autouse=True)
def restored() -> Iterator[None]:
    """Leave Python's logging, warnings and hooks as they were found."""
    root = logging.getLogger()
    handlers, hooks = root.handlers[:], (sys.excepthook, threading.excepthook)
    yield
    logging.captureWarnings(False)
    begin_log("test", Format.TEXT, "info")
    root.handlers[:] = handlers
    sys.excepthook, threading.excepthook = hooks


def lines(capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    return [json.loads(line) for line in capsys.readouterr().err.splitlines()]


def test_lines_for_people_have_a_name_in_front_and_nothing_else(capsys: pytest.CaptureFixture[str]) -> None:
    log = Log("r1")
    log.info("waiting for a router", place="here")
    log.warning("left")
    Log("router", "fogwatch router: ").error("the port is busy")
    Log("monitor", "").info("compiling")
    log.debug("not by default")
    Log("monitor", "").announce("page: http://127.0.0.1:1")
    out, err = capsys.readouterr()
    assert err == "r1: waiting for a router\nr1: left\nfogwatch router: the port is busy\ncompiling\n"
    assert out == "page: http://127.0.0.1:1\n"


def test_a_json_line_says_when_who_and_how_grave(capsys: pytest.CaptureFixture[str]) -> None:
    log = begin_log("r1", Format.JSON, "debug")
    log.debug("a")
    log.info("b", health={"tick": 3}, message="not this one")
    log.warning("c")
    log.error('two\nlines, "quoted" and \x1b[31m coloured \u202e')
    said = capsys.readouterr().err
    assert said.isascii()
    assert "\x1b" not in said
    told = [json.loads(line) for line in said.splitlines()]
    assert [line["level"] for line in told] == ["debug", "info", "warning", "error"]
    assert {line["process"] for line in told} == {"r1"}
    assert [line["message"] for line in told[:3]] == ["a", "b", "c"]
    assert told[1]["health"] == {"tick": 3}
    assert told[3]["message"].startswith("two\nlines")
    assert all(line["time"].endswith("Z") and line["time"][10] == "T" for line in told)


@pytest.mark.parametrize(("level", "left"), [("debug", 4), ("info", 3), ("warning", 2), ("error", 1)])
@pytest.mark.parametrize("form", list(Format))
def test_the_level_leaves_lines_out(form: Format, level: str, left: int, capsys: pytest.CaptureFixture[str]) -> None:
    log = begin_log("r1", form, level)
    assert logs.is_json() == (form is Format.JSON)
    for report in (log.debug, log.info, log.warning, log.error):
        report("line")
    log.announce("ready")
    out, err = capsys.readouterr()
    assert len(err.splitlines()) == left
    assert "ready" in out


def test_what_python_and_libraries_write_is_json_too(capsys: pytest.CaptureFixture[str]) -> None:
    begin_log("world", Format.JSON, "info")
    logging.getLogger("websockets.server").warning("closed %d", 3)
    logging.getLogger("websockets.server").info("left out")
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        warnings.warn("old", stacklevel=1)

    def fail() -> None:
        raise ValueError("in a thread")

    thread = threading.Thread(target=fail)
    thread.start()
    thread.join()
    told = lines(capsys)
    assert [line["process"] for line in told] == ["world"] * 3
    assert told[0]["library"] == "websockets.server"
    assert told[0]["message"] == "closed 3"
    assert "old" in told[1]["message"]
    assert told[2]["message"] == "ValueError: in a thread"
    assert "Traceback" in told[2]["traceback"]


@pytest.mark.parametrize("form", list(Format))
def test_a_crash_is_told_in_the_log(
    form: Format, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Left(Exception):
        pass

    def leave(code: int) -> None:
        raise Left(code)

    def crash() -> int:
        raise RuntimeError("our mistake")

    begin_log("r1", form, "error")
    monkeypatch.setattr("runtime.process.lifeline.leave", leave)
    with pytest.raises(Left) as left:
        run_process(crash)
    assert left.value.args == (CRASHED,)
    said = capsys.readouterr().err
    if form is Format.TEXT:
        assert said.startswith("Traceback (most recent call last):\n")
        assert said.endswith("RuntimeError: our mistake\n")
    else:
        (line,) = [json.loads(line) for line in said.splitlines()]
        assert line["level"] == "error"
        assert "crash" in line["traceback"]


def test_a_long_message_is_cut_in_its_middle(capsys: pytest.CaptureFixture[str]) -> None:
    begin_log("r1", Format.JSON, "info").info("a" * 100_000 + "end")
    (line,) = lines(capsys)
    assert len(line["message"]) < LONGEST + 100
    assert line["message"].endswith("end")


def test_a_log_that_nobody_can_write_ends_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    class Full:
        def write(self, _text: str) -> None:
            raise OSError(28, "no space left")

    monkeypatch.setattr(sys, "stderr", Full())
    Log("r1").info("goes on")
    monkeypatch.setattr(sys, "stderr", None)
    Log("r1").info("goes on")
