import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from patrol.errors import BadInput
from patrol.values import RobotName
from runtime.security.keys import fleet_keys
from runtime.security.roles import (
    COMMON_NAMES,
    OPERATOR,
    USERNAMES,
    VIEWER,
    WORLD_ROLE,
    Kind,
    Role,
    access_control,
    rights_of,
    robot_role,
    role_of,
    roles_of,
)

KEYS = fleet_keys("f")
NAMES = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_-]{0,31}", fullmatch=True)


def test_each_role_may_do_what_its_process_does_and_no_more() -> None:
    robot = rights_of(robot_role("r1"), KEYS)
    assert robot.publish == ("fogwatch/f/robot/r1/reply", "fogwatch/f/position/r1", "fogwatch/f/telemetry/r1")
    assert robot.hear == ("fogwatch/f/robot/r1/tick", "fogwatch/f/position/*")
    assert robot.announce == ("fogwatch/f/alive/r1",)
    assert (robot.ask, robot.answer) == ((), ("fogwatch/f/stop/r1",))
    world = rights_of(WORLD_ROLE, KEYS)
    assert world.publish == ("fogwatch/f/robot/*/tick", "fogwatch/f/truth/*")
    assert world.ask == ()
    viewer, operator = rights_of(VIEWER, KEYS), rights_of(OPERATOR, KEYS)
    assert (viewer.publish, viewer.answer, viewer.announce) == ((), (), ())
    assert (operator.publish, operator.answer, operator.announce) == ((), (), ())
    assert set(operator.ask) - set(viewer.ask) == {"fogwatch/f/control/*", "fogwatch/f/stop/*"}


@given(st.lists(NAMES, max_size=5, unique=True))
def test_roles_are_known_by_names_that_cannot_be_confused(names: list[str]) -> None:
    words = ("world", "viewer", "robot")
    roles = roles_of([*words, *(name for name in names if name not in words)])
    assert len({role.user for role in roles}) == len(roles)
    assert [role_of(role.user, "test") for role in roles] == list(roles)


@given(NAMES)
def test_a_robot_s_rule_covers_no_other_robot(name: str) -> None:
    rights = rights_of(robot_role(name), KEYS)
    for expression in (*rights.publish, *rights.announce, KEYS.tick(name)):
        assert not set("*$#?") & set(expression)
        assert expression.count("/") == expression.replace(name, "x").count("/")


@pytest.mark.parametrize("name", ["", "*", "**", "r*", "$*", "a/b", "a#b", "a?b", ".world", "r1\n", "ä", "a" * 33])
def test_a_name_that_could_mean_several_keys_is_no_robot_s(name: str) -> None:
    with pytest.raises(BadInput, match="not a robot's name"):
        robot_role(name)


@pytest.mark.parametrize("user", ["", "robot", "robot-", "robot-*", "world-1", "root", "operator-x"])
def test_a_name_that_no_role_has_is_refused(user: str) -> None:
    with pytest.raises(BadInput):
        role_of(user, "test")


@given(st.one_of(NAMES, st.text(max_size=40), st.from_regex(r"[A-Za-z0-9_.*-]{1,35}")))
def test_the_names_are_those_that_a_scenario_may_have(name: str) -> None:
    try:
        TypeAdapter(RobotName).validate_python(name)
    except ValidationError:
        with pytest.raises(BadInput):
            robot_role(name)
    else:
        assert robot_role(name).robot == name


def test_a_robot_named_twice_is_refused() -> None:
    with pytest.raises(BadInput, match="named twice"):
        roles_of(["r1", "r2", "r1"])


@pytest.mark.parametrize("known_by", [USERNAMES, COMMON_NAMES])
def test_the_router_denies_everything_that_no_rule_allows(known_by: str) -> None:
    roles = {role.user: role for role in roles_of(["r1", "r2"])}
    config = access_control(KEYS, roles, known_by)
    assert config["enabled"]
    assert config["default_permission"] == "deny"
    others = ["router.f"] if known_by == COMMON_NAMES else []
    assert [subject[known_by] for subject in config["subjects"]] == [[name] for name in (*roles, *others)]
    by_id = {rule["id"]: rule for rule in config["rules"]}
    assert len(by_id) == len(config["rules"])
    used = [rule for policy in config["policies"] for rule in policy["rules"]]
    assert sorted(used) == sorted(by_id), "each rule belongs to exactly one member"
    for rule in config["rules"]:
        assert rule["permission"] == "allow"
        assert all(expression.startswith("fogwatch/f/") for expression in rule["key_exprs"])
    sent = {
        policy["subjects"][0]: {
            key
            for rule in policy["rules"]
            if "put" in by_id[rule]["messages"] and by_id[rule]["flows"] == ["ingress"]
            for key in by_id[rule]["key_exprs"]
        }
        for policy in config["policies"]
    }
    assert sent["robot-r1"] == set(rights_of(Role(Kind.ROBOT, "r1"), KEYS).publish)
    assert sent["viewer"] == sent["operator"] == set()
