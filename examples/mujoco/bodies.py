"""Bodies in MuJoCo for simulated ROS 2 robots: driven wheels with inertia and slip, between walls made of the map.

    pip install -r examples/mujoco/requirements.lock
    fogwatch robot-sim --scenario examples/mujoco/office.yaml --bodies examples/mujoco/bodies.py:MujocoBodies \
        --connect tcp/127.0.0.1:7447 --robots robot1,robot2,robot3 --margin 0.1

docs/ros2/mujoco.md has the whole fleet. MuJoCo moves the bodies; all else, topics and score included, is robot-sim's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import cycle

import numpy as np
from numpy.typing import NDArray

from patrol.errors import BadInput
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.maps.load import read_terrain
from patrol.maps.map_file import read_map_file
from patrol.palette import ROBOTS, UNCOUNTED, rgb
from patrol.pose import Pose, Twist, wrap
from ros2.sim.bodies import Moved
from ros2.sim.robot import Build, SimulatedRobot

try:
    import mujoco
except ModuleNotFoundError:
    raise BadInput("examples/mujoco: needs MuJoCo; pip install -r examples/mujoco/requirements.lock") from None

TIMESTEP_S = 0.004
WALL_M = 0.5
"""Height of the walls, m."""
CLOSE_M = 0.002
"""Distance from which a body counts as touching, m, so that one that slides along a wall touches it once."""
WHEEL, TRACK = 0.32, 1.44
"""Radius of the wheels, and distance between them, as shares of the body's radius."""
DENSITY = 60.0
"""Mass per area of the body, kg/m²: 12 kg for a radius of 0.25 m."""
PUSH = 4.0
"""Acceleration that the motors' torque is good for, m/s²."""
GRIP = 0.35
"""Friction between wheels and floor; little enough that wheels spin before the motors stall."""
UNEVEN = 0.002
"""Standard deviation of the wheels' true radii, as a share; the odometry takes them to be equal."""
COUNTS = 2048
"""Counts of an encoder in one turn of a wheel."""
JITTER = 0.02
"""Standard deviation of what an encoder counts in a step, as a share of it."""

_WALL, _HULL, _FLOOR = 1, 2, 4  # bits by which MuJoCo decides what collides


def as_rgba(colour: str) -> list[float]:
    """Return a colour as MuJoCo wants it."""
    return [*(part / 255 for part in rgb(colour)), 1.0]


def merge_cells(occupied: BoolGrid) -> list[tuple[int, int, int, int]]:
    """Cover occupied cells with rectangles that do not overlap: first row, end row, first column, end column."""
    left = occupied.copy()
    rectangles = []
    for row, column in np.argwhere(occupied).tolist():
        if not left[row, column]:
            continue
        run = left[row, column:]
        end_column = column + (len(run) if run.all() else int(np.argmin(run)))
        end_row = row + 1
        while end_row < len(left) and left[end_row, column:end_column].all():
            end_row += 1
        left[row:end_row, column:end_column] = False
        rectangles.append((row, end_row, column, end_column))
    return rectangles


def add_walls(spec: mujoco.MjSpec, terrain: Terrain) -> None:
    """Extrude the map's occupied cells, and a frame of one cell around them, at the resolution of its image."""
    if terrain.source is not None:
        terrain = read_terrain(terrain.source, read_map_file(terrain.source).resolution)
    cell, (x, y) = terrain.point, terrain.origin
    for row, end_row, column, end_column in merge_cells(np.pad(~terrain.passable, 1, constant_values=True)):
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[0.5 * cell * (end_column - column), 0.5 * cell * (end_row - row), 0.5 * WALL_M],
            pos=[x + cell * (0.5 * (column + end_column) - 1), y + cell * (0.5 * (row + end_row) - 1), 0.5 * WALL_M],
            rgba=as_rgba(UNCOUNTED),
            contype=_WALL,
            conaffinity=_HULL,
        )


def add_robot(spec: mujoco.MjSpec, build: Build, wheel_radii: Sequence[float], rgba: Sequence[float]) -> None:
    """Add a round body on two driven wheels and two casters."""
    name, radius, start = build.spec.name, build.spec.radius, build.start
    mass, wheel = DENSITY * math.pi * radius**2, WHEEL * radius
    turned = [math.cos(0.5 * start.heading), 0, 0, math.sin(0.5 * start.heading)]
    body = spec.worldbody.add_body(name=name, pos=[start.x, start.y, 0], quat=turned)
    body.add_freejoint()
    height = 0.5 * radius
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[radius, height, 0],
        pos=[0, 0, wheel + height],
        mass=mass,
        rgba=rgba,
        friction=[0.3, 0.005, 0.0001],
        margin=CLOSE_M,
        gap=CLOSE_M,
        contype=_HULL,
        conaffinity=_HULL | _WALL,
    )
    body.add_geom(  # which way it faces
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[0.3 * radius, 0.1 * radius, 0.02],
        pos=[0.6 * radius, 0, wheel + 2 * height],
        mass=0,
        rgba=[1, 1, 1, 1],
        contype=0,
        conaffinity=0,
    )
    for side in (-1, 1):
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[0.1 * radius, 0, 0],
            pos=[side * 0.75 * radius, 0, 0.1 * radius + 0.002],
            mass=0.01 * mass,
            condim=1,  # without friction
            priority=1,
            contype=0,
            conaffinity=_FLOOR,
        )
    torque = 0.5 * PUSH * 1.2 * mass * wheel
    for side, true_radius in zip((1, -1), wheel_radii, strict=True):
        turning = body.add_body(pos=[0, side * 0.5 * TRACK * radius, true_radius])
        turning.add_joint(name=f"{name}:{side}", axis=[0, 1, 0], damping=0.01 * torque, frictionloss=0.05 * torque)
        turning.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=[true_radius, 0.06 * radius, 0],
            quat=[math.sqrt(0.5), math.sqrt(0.5), 0, 0],
            mass=0.05 * mass,
            rgba=[0.1, 0.1, 0.1, 1],
            friction=[GRIP, 0.005, 0.0001],
            contype=0,
            conaffinity=_FLOOR,
        )
        motor = spec.add_actuator(name=f"{name}:{side}", target=f"{name}:{side}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_velocity(kv=4.0 * torque)
        motor.forcelimited, motor.forcerange = True, [-torque, torque]


def make_model(terrain: Terrain, builds: Sequence[Build]) -> mujoco.MjModel:
    """Build floor, walls and robots."""
    spec = mujoco.MjSpec()
    spec.option.timestep = TIMESTEP_S
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    west, south, east, north = terrain.bounds
    flat = {"builtin": mujoco.mjtBuiltin.mjBUILTIN_FLAT, "rgb1": [1, 1, 1], "rgb2": [1, 1, 1]}
    spec.add_texture(type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, width=8, height=48, **flat)
    sides = {"width": terrain.width, "height": terrain.height}
    spec.add_texture(name="floor", type=mujoco.mjtTexture.mjTEXTURE_2D, nchannel=3, **sides, **flat)
    material = spec.add_material(name="floor")
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "floor"
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0.5 * (east - west), 0.5 * (north - south), 1],
        pos=[0.5 * (west + east), 0.5 * (south + north), 0],
        material="floor",
        friction=[GRIP, 0.005, 0.0001],
        contype=_FLOOR,
        conaffinity=0,
    )
    add_walls(spec, terrain)
    for build, colour in zip(builds, cycle(ROBOTS), strict=False):
        if build.spec.model != "differential":
            raise BadInput(f"{build.spec.name}: model {build.spec.model} is none of these bodies; give differential")
        shares = 1 + UNEVEN * np.random.default_rng((build.seed, build.spec.number)).standard_normal(2)
        add_robot(spec, build, (WHEEL * build.spec.radius * shares).tolist(), as_rgba(colour))
    model: mujoco.MjModel = spec.compile()
    return model


class MujocoBodies:
    """Moves the robots' bodies (`ros2.sim.bodies.Bodies`)."""

    def __init__(self, terrain: Terrain, builds: Sequence[Build]) -> None:
        self.model = make_model(terrain, builds)
        self.data = mujoco.MjData(self.model)
        names = [build.spec.name for build in builds]
        self._hulls = np.full(self.model.ngeom, -1)
        self._hulls[[self.model.geom(name).id for name in names]] = range(len(names))
        self._bodies = [self.model.body(name).id for name in names]
        wheels = [[self.model.joint(f"{name}:{side}") for side in (1, -1)] for name in names]
        self._turns = np.array([[int(joint.qposadr[0]) for joint in pair] for pair in wheels])
        self._noise = [np.random.default_rng((build.seed, build.spec.number, 1)) for build in builds]
        self._counts = self._read_encoders()
        mujoco.mj_forward(self.model, self.data)

    def move(self, robots: Sequence[SimulatedRobot], step_s: float) -> list[Moved]:
        """Set the wheels' speeds, let the physics run for a step, and read encoders and contacts."""
        radii = np.array([robot.build.spec.radius for robot in robots])
        commands = [robot.body.command for robot in robots]
        told = np.array([(twist.speed, twist.turn_rate) for twist in commands if isinstance(twist, Twist)])
        apart = 0.5 * TRACK * radii * told[:, 1]
        self.data.ctrl[0::2] = (told[:, 0] - apart) / (WHEEL * radii)  # left wheels
        self.data.ctrl[1::2] = (told[:, 0] + apart) / (WHEEL * radii)
        at_wall, at_robot = np.zeros(len(robots), dtype=bool), np.zeros(len(robots), dtype=bool)
        for _ in range(round(step_s / self.model.opt.timestep)):
            mujoco.mj_step(self.model, self.data)
            touching = self._hulls[self.data.contact.geom]
            for first, second in touching[(touching >= 0).any(axis=1)]:
                touched = at_robot if min(first, second) >= 0 else at_wall
                touched[[robot for robot in (first, second) if robot >= 0]] = True
        counts = self._read_encoders()
        turned, self._counts = (counts - self._counts) * (2 * math.pi / COUNTS), counts
        moved = []
        for number, radius in enumerate(radii.tolist()):
            noise = 1 + JITTER * self._noise[number].standard_normal(2)
            left, right = (WHEEL * radius * turned[number] * noise).tolist()
            ahead, turn = 0.5 * (left + right), (right - left) / (TRACK * radius)
            counted = Pose(ahead * math.cos(0.5 * turn), ahead * math.sin(0.5 * turn), turn)
            moved.append(Moved(self.pose(number), counted, bool(at_wall[number]), bool(at_robot[number])))
        return moved

    def pose(self, number: int) -> Pose:
        """Return the true pose of a robot, by its place in the list of builds."""
        body = self._bodies[number]
        x, y, _ = self.data.xpos[body].tolist()
        rotation = self.data.xmat[body]
        return Pose(x, y, wrap(math.atan2(rotation[3], rotation[0])))

    def _read_encoders(self) -> NDArray[np.float64]:
        """Return the whole counts of both wheels of each robot, left and right."""
        return np.floor(self.data.qpos[self._turns] * (COUNTS / (2 * math.pi)))
