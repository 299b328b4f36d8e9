"""Names, tokens, attachments and keys, against the examples in the public design text of rmw_zenoh."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.errors import BadInput
from ros2.wire import names
from ros2.wire.formats import Attachment, Bridge, RmwZenoh, attachment_of, format_named, gid_of, other_format
from ros2.wire.names import LATCHED, SENSOR, USUAL, Entity, EntityKind, NodeName, Qos

STRING = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
TWIST = "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a"
ADD = "RIHS01_e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a"
LISTENER, TALKER = NodeName("listener"), NodeName("talker")
ONE, TWO = "aac3178e146ba6f1fc6e6a4085e77f21", "8b20917502ee955ac4476e0266340d5c"
ADDER = "f9980ee0495eaafb3e38f0d19e2eae12"
ADD_TYPE, ADD_DDS = "example_interfaces/srv/AddTwoInts", "example_interfaces::srv::dds_::AddTwoInts_"
ADDING = "add_two_ints_server"

TOKENS = [
    (f"@ros2_lv/2/{ONE}/0/0/NN/%/%/listener", Entity(2, ONE, 0, 0, EntityKind.NODE, LISTENER)),
    (
        f"@ros2_lv/2/{ONE}/0/10/MS/%/%/listener/%chatter/std_msgs::msg::dds_::String_/{STRING}/::,10:,:,:,,",
        Entity(2, ONE, 0, 10, EntityKind.SUBSCRIPTION, LISTENER, "/chatter", "std_msgs/msg/String", STRING, USUAL),
    ),
    (
        f"@ros2_lv/2/{TWO}/0/10/MP/%/%/talker/%chatter/std_msgs::msg::dds_::String_/{STRING}/::,7:,:,:,,",
        Entity(2, TWO, 0, 10, EntityKind.PUBLISHER, TALKER, "/chatter", "std_msgs/msg/String", STRING, Qos(depth=7)),
    ),
    (
        f"@ros2_lv/2/{ADDER}/0/10/SS/%/%/{ADDING}/%add_two_ints/{ADD_DDS}/{ADD}/::,10:,:,:,,",
        Entity(2, ADDER, 0, 10, EntityKind.SERVER, NodeName(ADDING), "/add_two_ints", ADD_TYPE, ADD, USUAL),
    ),
]
"""Those of the design text."""


@pytest.mark.parametrize(("token", "entity"), TOKENS)
def test_tokens_are_those_of_the_design_text(token: str, entity: Entity) -> None:
    assert entity.token == token
    assert names.entity_of(token) == entity


def test_keys_are_those_of_the_design_text() -> None:
    assert RmwZenoh().key("/chatter", "std_msgs/msg/String") == f"0/chatter/std_msgs::msg::dds_::String_/{STRING}"
    key = RmwZenoh().key(names.full_name("robot1", "chatter"), "std_msgs/msg/String")
    assert key == f"0/robot1/chatter/std_msgs::msg::dds_::String_/{STRING}"
    asked = RmwZenoh(2).service_key("/add_two_ints", ADD_TYPE)
    assert asked == "2/add_two_ints/example_interfaces::srv::dds_::AddTwoInts_/*"  # whatever hash the server has
    twist = RmwZenoh().key("/robot1/cmd_vel", "geometry_msgs/msg/Twist")
    assert twist == f"0/robot1/cmd_vel/geometry_msgs::msg::dds_::Twist_/{TWIST}"
    humble = RmwZenoh(hashed=False).key("/robot1/cmd_vel", "geometry_msgs/msg/Twist")
    assert humble == "0/robot1/cmd_vel/geometry_msgs::msg::dds_::Twist_/TypeHashNotSupported"


def test_the_bridge_s_keys_are_names() -> None:
    assert Bridge().key("/robot1/cmd_vel", "geometry_msgs/msg/Twist") == "robot1/cmd_vel"
    assert Bridge().service_key("/add_two_ints", ADD_TYPE) == "add_two_ints"


def test_an_entity_in_a_namespace() -> None:
    node = NodeName("fogwatch", "/fleet/robot1")
    topic, kind = "/fleet/robot1/cmd_vel", "geometry_msgs/msg/Twist"
    entity = Entity(0, ONE, 3, 4, EntityKind.PUBLISHER, node, topic, kind, TWIST, USUAL)
    assert entity.token == (
        f"@ros2_lv/0/{ONE}/3/4/MP/%/%fleet%robot1/fogwatch/%fleet%robot1%cmd_vel/"
        f"geometry_msgs::msg::dds_::Twist_/{TWIST}/::,10:,:,:,,"
    )
    assert names.entity_of(entity.token) == entity


def test_an_attachment_has_33_bytes() -> None:
    sent = Attachment(1, 0x0102030405060708, bytes(range(16)))
    # From the text: sequence and time as little endian, the length of the id, the id.
    expected = bytes.fromhex("0100000000000000" + "0807060504030201" + "10" + "000102030405060708090a0b0c0d0e0f")
    assert sent.to_bytes() == expected
    assert attachment_of(expected) == sent


@given(st.binary(max_size=80))
def test_other_bytes_are_no_attachment(given_bytes: bytes) -> None:
    found = attachment_of(given_bytes)
    assert (found is None) or found.to_bytes() == given_bytes


def test_an_id_stands_for_one_entity() -> None:
    assert len({gid_of(token) for token, _ in TOKENS}) == len(TOKENS)
    assert {len(gid_of(token)) for token, _ in TOKENS} == {16}


def test_quality_of_service() -> None:
    assert [qos.text for qos in (USUAL, LATCHED, SENSOR)] == ["::,10:,:,:,,", ":1:,1:,:,:,,", "2::,5:,:,:,,"]


@given(st.text(alphabet="@ros2_lv/MPNSC%:,0123abc\x1b ", max_size=120) | st.text(max_size=60))
def test_any_token_is_read_or_is_none(token: str) -> None:
    names.entity_of(token)
    names.entity_of(f"@ros2_lv/0/a/0/1/MP/%/%/n/%t/a::msg::dds_::B_/h/{token}")


@pytest.mark.parametrize(
    "token", ["", "@ros2_lv", TOKENS[0][0].replace("/0/0/NN", "/x/0/NN"), f"@ros2_lv/{'9' * 30}/a/0/0/NN/%/%/n"]
)
def test_what_is_no_token(token: str) -> None:
    assert names.entity_of(token) is None


def test_names_are_resolved_as_in_ros() -> None:
    assert [names.full_name("robot1", name) for name in ("odom", "/tf")] == ["/robot1/odom", "/tf"]
    assert [names.full_name(space, "odom") for space in ("", "/", "/a/b")] == ["/odom", "/odom", "/a/b/odom"]
    assert names.dds_name("nav_msgs/msg/Odometry") == "nav_msgs::msg::dds_::Odometry_"
    assert names.ros_name("nav_msgs::msg::dds_::Odometry_") == "nav_msgs/msg/Odometry"
    assert names.ros_name("anything") == "anything"


@pytest.mark.parametrize("name", ["*", "a b", "robot1/", "a//b", "1robot", "a/**", "@adv", "x" * 256, "a\n"])
def test_what_is_no_name_is_refused_in_one_line(name: str) -> None:
    with pytest.raises(BadInput, match="not a name in ROS") as caught:
        names.check_name(name, "--namespace")
    assert "\n" not in str(caught.value)


def test_what_is_a_name_and_a_domain() -> None:
    assert [names.check_name(name, "test") for name in ("", "/", "robot1", "/fleet/robot_1")]
    assert [names.check_domain(domain, "test") for domain in (0, 232)] == [0, 232]
    with pytest.raises(BadInput, match="0 to 232"):
        names.check_domain(233, "--domain")


def test_formats_have_names() -> None:
    assert format_named("rmw_zenoh", 3, "test") == RmwZenoh(3)
    assert format_named("rmw_zenoh-humble", 3, "test") == RmwZenoh(3, hashed=False)
    assert format_named("bridge", 3, "test") == Bridge()
    with pytest.raises(BadInput, match="known are rmw_zenoh, rmw_zenoh-humble, bridge"):
        format_named("dds", 0, "--format")


def test_the_format_of_the_nodes_on_a_router_is_told_where_it_is_another_one() -> None:
    bridged = f"@/{ONE}/@ros2_lv/MP/§chatter/std_msgs§msg§String"
    spoken = {RmwZenoh().graph: [f"@ros2_lv/0/{ONE}/0/0/NN/%/%/listener"], Bridge().graph: [bridged]}
    assert other_format(Bridge(), lambda graph: spoken[graph]) == "rmw_zenoh; give --format rmw_zenoh"
    assert other_format(RmwZenoh(), lambda graph: spoken[graph]) == "zenoh-bridge-ros2dds; give --format bridge"
    assert other_format(Bridge(), lambda _: []) == ""
    assert other_format(Bridge(), lambda _: ["@ros2_lv/nothing"]) == ""
