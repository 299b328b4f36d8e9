"""Film a patrol of MuJoCo bodies from the true poses that robot-sim has written: the fog on the floor, robots on it.

    MUJOCO_GL=egl python examples/mujoco/film.py poses.csv --from 200 --to 320 --out patrol.webp

Bright floor was seen just now, dark floor long ago. Without a display, MUJOCO_GL names what MuJoCo draws with: egl, or
osmesa.
"""

import argparse
import csv
import math
import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby
from pathlib import Path

from PIL import Image

from monitor.figures.ground import fog_scale
from patrol.errors import BadInput
from patrol.pose import Pose
from patrol.prepare import Prepared, prepare, sensor_footprint
from patrol.scenario import load_scenario, naming
from ros2.sim.odometry import Errors
from ros2.sim.robot import Build
from worldsim.truth import Truth

try:
    from bodies import make_model, mujoco
except BadInput as bad:
    print(f"film: {bad}", file=sys.stderr)
    sys.exit(2)


WIDTH, HEIGHT = 640, 358
EVERY, PAUSE_MS = 2, 100
"""Ticks from one frame to the next, and for how long each is shown."""
STALEST_S = 60.0
"""Age of the darkest floor, s."""


def read_poses(path: Path) -> Iterator[tuple[float, dict[str, Pose]]]:
    """Read the poses of each tick."""
    with path.open(encoding="ascii", newline="") as file:
        for time_s, rows in groupby(csv.DictReader(file), key=lambda row: float(row["time_s"])):
            yield time_s, {row["robot"]: Pose(*(float(row[name]) for name in ("x", "y", "heading"))) for row in rows}


class Scene:
    """Draws the robots and the fog of one moment."""

    def __init__(self, prepared: Prepared, margin_m: float) -> None:
        scenario = prepared.scenario
        self.truth = Truth(sensor_footprint(scenario, prepared.terrain), prepared.patrolled)
        self.specs = [replace(spec, radius=spec.radius - margin_m) for spec in scenario.roster]
        builds = [Build(spec, Pose(0.0, 0.0, 0.0), Errors(), math.inf, 0.5, 0) for spec in self.specs]
        self._model = make_model(prepared.terrain, builds)
        self._model.vis.headlight.ambient[:] = 0.5
        self._data = mujoco.MjData(self._model)
        self._step_s, self._colours = scenario.step, fog_scale(STALEST_S)
        west, south, east, north = prepared.terrain.bounds
        self._camera = mujoco.MjvCamera()
        self._camera.lookat[:] = [0.5 * (west + east), 0.5 * (south + north) - 0.3, 0]
        self._camera.distance, self._camera.azimuth, self._camera.elevation = 0.82 * (east - west), 90, -66

    def draw(self, tick: int, poses: dict[str, Pose]) -> Image.Image:
        """Draw a tick."""
        ages_s = (tick - self.truth.fog.last_seen) * self._step_s
        pixels = self._colours.to_rgba(ages_s, bytes=True)[::-1, :, :3]  # the first row lies at the highest y
        begin = int(self._model.texture("floor").adr[0])
        self._model.tex_data[begin : begin + pixels.size] = pixels.ravel()
        for spec in self.specs:
            pose = poses[spec.name]
            joint = self._data.joint(self._model.body(spec.name).jntadr[0])
            turned = [math.cos(0.5 * pose.heading), 0, 0, math.sin(0.5 * pose.heading)]
            joint.qpos[:] = [pose.x, pose.y, 0, *turned]
        mujoco.mj_forward(self._model, self._data)
        with mujoco.Renderer(self._model, HEIGHT, WIDTH) as renderer:  # a new one takes the new floor
            renderer.update_scene(self._data, self._camera)
            return Image.fromarray(renderer.render())


def main() -> None:
    """Write the film."""
    beside = Path(__file__).parent
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("poses", type=Path, help="what robot-sim wrote with --poses")
    parser.add_argument("--scenario", type=Path, default=beside / "office.yaml", help="the scenario of that patrol")
    parser.add_argument("--margin", type=float, default=0.1, help="by which its radii exceed the bodies (%(default)s)")
    parser.add_argument("--from", dest="begin_s", type=float, default=0.0, help="patrol time at the beginning, s")
    parser.add_argument("--to", dest="end_s", type=float, default=math.inf, help="patrol time at the end, s")
    parser.add_argument("--out", type=Path, default=Path("patrol.webp"), help="an animated WebP (default: %(default)s)")
    options = parser.parse_args()
    with naming(options.scenario):
        prepared = prepare(load_scenario(options.scenario))
    scene = Scene(prepared, options.margin)
    frames = []
    for tick, (time_s, poses) in enumerate(read_poses(options.poses)):
        scene.truth.observe(tick, [(spec.number, poses[spec.name]) for spec in scene.specs])
        if options.begin_s <= time_s <= options.end_s and tick % EVERY == 0:
            frames.append(scene.draw(tick, poses))
    if not frames:
        raise BadInput(f"{options.poses}: has no poses from {options.begin_s:g} to {options.end_s:g} s; give others")
    first, *others = frames
    first.save(options.out, save_all=True, append_images=others, duration=PAUSE_MS, loop=0, quality=55)
    print(f"wrote {options.out}: {len(frames)} frames")


if __name__ == "__main__":
    try:
        main()
    except (BadInput, OSError) as error:
        print(f"film: {error}", file=sys.stderr)
        sys.exit(2)
