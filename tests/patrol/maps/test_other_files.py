from pathlib import Path

import pytest

from patrol.errors import BadInput
from patrol.maps.load import read_terrain
from patrol.maps.map_file import read_map_file
from patrol.scenario import load_scenario
from tests.patrol.maps.test_maps import WHITE, write_map


@pytest.mark.parametrize(
    ("named", "there", "meant"),
    [
        ("map.pgm", ["plan.pgm", "other.png"], "plan.pgm"),
        ("map.pgm", ["Map.PNG", "plan.pgm"], "Map.PNG"),
        ("map.pgm", ["floor.bmp"], ""),
        ("images/lab.pgm", ["plan.png", "images/LAB.png", "images/plan.png"], "images/LAB.png"),
        ("images/lab.pgm", ["lab.png", "images/other.png"], "lab.png"),
        ("map.pgm", ["a.png", "b.png"], ""),
    ],
)
def test_an_image_of_another_ending_or_case_is_named(tmp_path: Path, named: str, there: list[str], meant: str) -> None:
    (tmp_path / "images").mkdir()
    path = write_map(tmp_path, WHITE, {"image": named})
    (tmp_path / named).unlink()
    for name in there:
        WHITE.save(tmp_path / name)
    with pytest.raises(BadInput) as error:
        read_terrain(path, 0.1)
    assert (f"set image: {meant}, which exists" if meant else "correct 'image'") in str(error.value)


def test_an_image_that_is_a_git_lfs_pointer_is_named(tmp_path: Path) -> None:
    path = write_map(tmp_path, b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 1\n")
    with pytest.raises(BadInput, match=r"plan\.pgm: is a Git LFS pointer .*git lfs pull"):
        read_terrain(path, 0.1)


FOREIGN = [
    (b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 1\n", "a Git LFS pointer"),
    (b"\x89MCAP0\r\n", "a bag of ROS"),
    (b"SQLite format 3\0" + bytes(100), "a bag of ROS"),
    (b"#ROSBAG V2.0\n" + bytes(range(256)), "a bag of ROS"),
    (b"rosbag2_bagfile_information: {version: 5}\n", "describes a bag of ROS"),
    (b"type octile\nheight 1\nwidth 1\nmap\n.\n", "a grid of MovingAI"),
    (b"<svg xmlns='http://www.w3.org/2000/svg'/>", "an SVG drawing"),
    (b"<?xml version='1.0'?>\n<sdf version='1.6'/>", "a world of Gazebo"),
    (b"\xef\xbb\xbf<svg xmlns='http://www.w3.org/2000/svg'/>", "an SVG drawing"),
    (b"  0\nSECTION\n  2\nHEADER\n", "a DXF drawing"),
    (b"  0\r\nSECTION\r\n  2\r\nHEADER\r\n", "a DXF drawing"),
    (b"999\r\ndrawn by hand\r\n  0\r\nSECTION\r\n", "a DXF drawing"),
    (b"AutoCAD Binary DXF\r\n\x1a\0" + bytes(range(256)), "a DXF drawing"),
    (b'{"verts": [[0, 0]], "room_category": {}, "room_num": 1}', "a floor plan of HouseExpo"),
    (b'{"type": "FeatureCollection", "features": []}', "a route graph in GeoJSON.*terrain.graph"),
    (b"building_name: shop\nlevels: {}\nlifts: {}\n", "a navigation graph of Open-RMF.*terrain.graph"),
    (b"coordinate_system: reference_image\nlevels: {}\nlifts: {}\n", "a building of Open-RMF"),
    (b"levels: {}\nlifts: {}\nname: shop\n", "a building of Open-RMF"),
    (b"coordinate_system: reference_image\ngraphs: {}\nlevels: {}\n", "a building of Open-RMF"),
]


@pytest.mark.parametrize(("content", "kind"), FOREIGN, ids=[kind for _, kind in FOREIGN])
def test_another_kind_of_file_is_named_in_one_line(tmp_path: Path, content: bytes, kind: str) -> None:
    path = tmp_path / "site.yaml"
    path.write_bytes(content)
    for read in (read_map_file, load_scenario):
        with pytest.raises(BadInput, match=rf"\A[^\n]*site\.yaml: (is )?{kind}[^\n]*\Z"):
            read(path)
