import numpy as np

from patrol.changing.ground import ChangingFootprint, ChangingTerrain, faces
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import Terrain
from patrol.pose import Pose

HALL = Terrain("hall", np.ones((9, 20), dtype=np.bool_), 1.0)
HERE = Pose(4.5, 4.5, 0.0)


def wall() -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    """A closed strip across the hall, two points thick."""
    closed = np.zeros((9, 20), dtype=np.bool_)
    closed[:, 8:10] = True
    return closed


def test_closed_points_stop_bodies_and_sight_until_they_open() -> None:
    ground = ChangingTerrain(HALL)
    assert ground.room.max() > 0
    ground.close(wall())
    assert not ground.free[:, 8].any()
    assert ground.blocked[4, 9] == 1
    assert ground.room[4, 7] == 1
    ground.close(np.zeros((9, 20), dtype=np.bool_))
    assert ground.free.all()
    assert HALL.passable.all()


def test_a_sensor_sees_the_face_of_what_is_closed_and_nothing_behind() -> None:
    sight = ChangingFootprint(lambda terrain: footprint_of(terrain, 8.0), HALL)
    assert sight.visible(HERE).shows(4, 11)
    sight.close(wall())
    view = sight.visible(HERE)
    assert view.shows(4, 7)
    assert not view.shows(4, 11)
    rows, cols = np.divmod(faces(view, wall()), 20)
    assert set(cols.tolist()) == {8}
    assert 4 in rows
    sight.close(np.zeros((9, 20), dtype=np.bool_))
    assert sight.visible(HERE).shows(4, 11)
    assert faces(footprint_of(HALL, 2.0).visible(HERE), wall()).size == 0, "nothing closed is in this window"
