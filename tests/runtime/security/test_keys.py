import pytest

from patrol.errors import BadInput
from runtime.security.keys import (
    WORLD,
    address_of,
    check_locator,
    check_locators,
    check_radio,
    fleet_keys,
    is_group,
    is_local,
    robot_of,
)


def test_the_keys_of_a_fleet_tell_its_robots() -> None:
    keys = fleet_keys("yards-1")
    assert keys.tick("r1") == "fogwatch/yards-1/robot/r1/tick"
    assert keys.reply("*") == "fogwatch/yards-1/robot/*/reply"
    assert keys.position("r1") == "fogwatch/yards-1/position/r1"
    assert keys.telemetry("r1") == "fogwatch/yards-1/telemetry/r1"
    assert keys.truth("metrics") == "fogwatch/yards-1/truth/metrics"
    assert keys.control("kill") == "fogwatch/yards-1/control/kill"
    assert keys.alive(WORLD) == "fogwatch/yards-1/alive/.world"
    keys = fleet_keys("f")
    makers = (keys.tick, keys.reply, keys.position, keys.telemetry, keys.alive)
    assert {robot_of(make("anna")) for make in makers} == {"anna"}
    assert robot_of("fogwatch/f") == ""


@pytest.mark.parametrize("name", ["", "a/b", "*", "a b", "ä", "x" * 129, "$*", "#", "?"])
def test_a_name_that_is_no_part_of_a_key_is_bad_input(name: str) -> None:
    with pytest.raises(BadInput, match="--fleet"):
        fleet_keys(name)


@pytest.mark.parametrize(
    "locator",
    [
        *("tcp/127.0.0.1:7447", "tls/router.example:1", "tcp/[::1]:65535", "udp/a:7"),
        *("quic/10.0.0.1:7447?mixed_rel=1", "udp/10.0.0.1:7447?rel=1;mixed_rel=1"),
    ],
)
def test_addresses_of_routers(locator: str) -> None:
    assert check_locator(locator, "--router") == locator


@pytest.mark.parametrize(
    "locator",
    [
        *("", "here", "127.0.0.1:7447", "tcp/host", "tcp/host:0", "tcp/host:65536", "tcp/:x", "tcp/a:1,tcp/b:1"),
        *(f"quic/h:1?{settings}" for settings in ("", "mixed_rel=2", "mixed_rel=1;", "so_sndbuf=1")),
    ],
)
def test_other_addresses_are_bad_input(locator: str) -> None:
    with pytest.raises(BadInput, match="--router"):
        check_locator(locator, "--router")


@pytest.mark.parametrize(
    "host",
    [
        *("224.0.0.1", "239.255.255.255", "240.0.0.0", "255.255.255.255", "[ff02::1]", "[ff02::1%eth0]"),
        *("4294967295", "0377.0377.0377.0377", "255.255.255.255.", "300.1.1.1", "10.1", "0xffffffff", "[1]"),
    ],
)
def test_what_no_machine_has_as_its_address_is_bad_input(host: str) -> None:
    with pytest.raises(BadInput, match=r"--router .*: not the address of one machine"):
        check_locator(f"tcp/{host}:7447", "--router")


@pytest.mark.parametrize("host", ["223.255.255.255", "0.0.0.0", "[::]", "[fe80::1%eth0]", "10.example", "0x1.example"])
def test_what_a_machine_can_have_or_listen_at_is_no_such_address(host: str) -> None:
    check_locator(f"tcp/{host}:7447", "--router")


def test_routers_that_are_tried_in_turn() -> None:
    both = "tls/a:7447,quic/[::1]:7448?mixed_rel=1"
    assert check_locators(both, "--router") == both
    assert [address_of(one) for one in both.split(",")] == [("a", 7447), ("::1", 7448)]
    assert is_local("tcp/127.0.0.1:1,tcp/[::1]:2")
    assert not is_local(both)
    with pytest.raises(BadInput, match="--router 'b'"):
        check_locators("tls/a:7447,b", "--router")


@pytest.mark.parametrize("radio", ["udp/224.0.0.225:7448", "udp/239.1.2.3:1#iface=wlan0"])
def test_groups_that_robots_can_hear_each_other_by(radio: str) -> None:
    assert is_group(radio)
    assert check_radio(radio, "--radio", "direct") == radio


def test_a_router_is_a_radio_too_and_none_is_none() -> None:
    for router in ("tcp/10.0.0.1:7448", "quic/h:1?mixed_rel=1,quic/i:1?mixed_rel=1", "udp/h:1?rel=1;mixed_rel=1"):
        assert check_radio(router, "--radio", "direct") == router
    assert not is_group("tcp/10.0.0.1:7448")
    assert check_radio(None, "--radio", "ether") is None


@pytest.mark.parametrize(
    "radio",
    [
        *("", "224.0.0.225:7448", "tcp/224.0.0.225:1#iface=a", "udp/224.0.0.225:0", "udp/10.0.0.1:7448"),
        *("udp/h:1#iface=a", "tcp/g:99999", "tcp/g:1,", "udp/g:1?mixed_rel=1"),
    ],
)
def test_other_radios_are_bad_input(radio: str) -> None:
    with pytest.raises(BadInput, match="--radio"):
        check_radio(radio, "--radio", "direct")


def test_a_radio_without_direct_radio_is_bad_input() -> None:
    with pytest.raises(BadInput, match=r"radio\.via is ether; set it to direct"):
        check_radio("udp/10.0.0.1:7448", "--radio", "ether")
