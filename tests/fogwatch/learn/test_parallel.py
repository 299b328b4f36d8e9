"""The environment of a fleet: PettingZoo's rules, and the same world as any run."""

import math
from typing import Any

import numpy as np
import pettingzoo
import pytest
from pettingzoo.test import parallel_api_test

from fogwatch.inprocess import run_in_process
from fogwatch.learn import PARALLEL_ID, Layers, PatrolEnv, action_of, flattened, parallel_env
from patrol.errors import BadInput
from patrol.scenario import load_scenario
from worldsim.verdict.judge import judge

ROBOTS = {"count": 3, "model": "holonomic"}
FLEET: dict[str, Any] = {"terrain": {"builtin": "yards"}, "point": 1.0, "duration": 40.0, "seed": 3, "robots": ROBOTS}
FAULTS = [
    {"kind": "loss", "rate": 0.4},
    {"kind": "kill", "at": 6, "who": "r2"},
    {"kind": "pause", "at": 4, "for": 5, "who": "r1"},
    {"kind": "kill", "at": 8, "who": "r3"},
    {"kind": "restart", "at": 12, "who": "r3"},
]
KINDS = [("bearing", "tick"), ("place", "tick"), ("place", "arrival"), ("node", "arrival")]


def drawn(env: PatrolEnv, observations: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """Actions for all agents, among those that the mask allows."""
    actions: dict[str, Any] = {}
    for agent in env.agents:
        mask = observations[agent].get("action_mask")
        actions[agent] = rng.uniform(-1, 1, 2) if mask is None else int(rng.choice(np.flatnonzero(mask)))
    return actions


def play(env: PatrolEnv, seed: int, steps: int) -> tuple[str, list[float]]:
    """Take random actions; return the trace hash so far and all rewards."""
    rng = np.random.default_rng(seed)
    observations, _ = env.reset(seed=seed)
    rewards = []
    for _ in range(steps):
        observations, gained, *_ = env.step(drawn(env, observations, rng))
        rewards.append(next(iter(gained.values())))
    assert env.episode is not None
    return env.episode.trace_hash, rewards


@pytest.mark.parametrize(("actions", "decide"), KINDS)
@pytest.mark.parametrize("faults", [[], FAULTS], ids=["calm", "faults"])
def test_it_keeps_the_rules_of_pettingzoo(actions: str, decide: str, faults: list[Any]) -> None:
    env = pettingzoo.make("parallel", PARALLEL_ID, scenario={**FLEET, "faults": faults}, actions=actions, decide=decide)
    parallel_api_test(env, num_cycles=200)


@pytest.mark.parametrize(("actions", "decide", "steps"), [("bearing", "tick", 500), ("node", "arrival", 30)])
def test_the_same_seed_and_actions_give_the_same_trace(actions: Any, decide: Any, steps: int) -> None:
    scenario = {**FLEET, "duration": 2000.0, "faults": FAULTS}
    one, other = (parallel_env(scenario, actions=actions, decide=decide, inputs=["pose"]) for _ in range(2))
    first = play(one, 5, steps)
    assert first == play(other, 5, steps)
    assert first[0] != play(one, 6, steps)[0]
    assert first == play(one, 5, steps)


@pytest.mark.parametrize(("actions", "decide"), KINDS)
def test_a_trained_network_decides_in_a_run_as_in_training(tmp_path: Any, actions: str, decide: str) -> None:
    settings: dict[str, Any] = {"actions": actions, "decide": decide, "inputs": ["sectors", "pose"]}
    intruders = [{"place": [95.0, 36.5], "at": 1, "for": 20}]
    scenario = {**FLEET, "duration": 80.0, "faults": FAULTS, "intruders": intruders}
    env = parallel_env(scenario, keep=True, **settings)
    network = random_network(env)
    observations, infos = env.reset()
    while env.agents:
        observations, _, _, _, infos = env.step(decided(network, observations, infos))
    assert env.episode is not None
    network.save(tmp_path / "trained.npz")
    patrol = {"policy": "learned", "options": {"weights": "trained.npz", **settings}}
    outcome = run_in_process(load_scenario({**scenario, "patrol": patrol}, base=tmp_path))
    assert outcome.verdict.valid, outcome.verdict.failed
    assert outcome.journal.end is not None
    assert outcome.journal.end.trace_hash == env.episode.trace_hash
    rows = [row for record in outcome.journal.ticks for row in record.robots]
    assert len(rows) == 160 * 3
    assert any(row.state == "surrounding" for row in rows)
    verdict = judge(env.episode.journal, {}, env.prepared)
    assert verdict.valid, verdict.failed


def random_network(env: PatrolEnv) -> Layers:
    rng = np.random.default_rng(4)
    outputs = getattr(env.action_space(env.possible_agents[0]), "n", 2)
    weights = [rng.normal(size=(44, 8)), rng.normal(size=(8, outputs))]
    return Layers(weights, [rng.normal(size=8), np.zeros(outputs)])


def decided(network: Layers, observations: dict[str, Any], infos: dict[str, Any]) -> dict[str, Any]:
    return {
        agent: action_of(network(flattened(parts)), parts.get("action_mask"))
        for agent, parts in observations.items()
        if agent in infos and infos[agent]["active"]
    }


def test_silent_robots_are_inactive_dead_ones_terminated_and_observations_in_their_space() -> None:
    env = parallel_env({**FLEET, "faults": FAULTS})
    rng = np.random.default_rng(1)
    observations, infos = env.reset()
    told: dict[int, list[str]] = {}
    ends: dict[str, tuple[int, str]] = {}
    for step in range(1, 200):
        if not env.agents:
            break
        for agent, parts in observations.items():
            assert env.observation_space(agent).contains(parts)
        observations, _, gone, ended, infos = env.step(drawn(env, observations, rng))
        told[step] = [agent for agent, info in infos.items() if info["active"]]
        for agent in gone:
            if gone[agent] or ended[agent]:
                ends[agent] = step, "gone" if gone[agent] else "ended"
        for agent, info in infos.items():
            if not info["active"] and not gone[agent] and not ended[agent]:
                assert not any(values.any() for name, values in observations[agent].items() if name != "action_mask")
    # Ticks of 0.5 s: r2 is killed at 6 s for good, r1 pauses from 4 to 9 s, r3 is dead from 8 to 12 s.
    assert ends == {"r2": (12, "gone"), "r1": (80, "ended"), "r3": (80, "ended")}
    active = [" ".join(told[step]) for step in (7, 8, 12, 15, 16, 18, 24)]
    assert active == ["r1 r2 r3", "r2 r3", "r3", "r3", "", "r1", "r1 r3"]


def test_a_spare_robot_is_an_agent_once_it_will_join() -> None:
    spare = {**FLEET, "robots": {**FLEET["robots"], "spare": 1}}
    env = parallel_env(spare)
    env.reset()
    assert env.agents == ["r1", "r2", "r3"]
    env = parallel_env({**spare, "faults": [{"kind": "join", "at": 5, "who": "r4"}]})
    _, infos = env.reset()
    assert env.agents == ["r1", "r2", "r3", "r4"]
    assert not infos["r4"]["active"]
    for _ in range(10):
        _, _, _, _, infos = env.step({})
    assert infos["r4"]["active"]


def test_rewards_come_from_the_true_fog() -> None:
    ages: list[tuple[float, float]] = []
    options: dict[str, Any] = {"policy": "learned", "options": {"inputs": ["pose"]}}
    for reward in ("mean", "mfow", "change"):
        env = parallel_env({**FLEET, "patrol": options}, reward=reward)
        env.reset()
        episode = env.episode
        assert episode is not None
        rewards = []
        ages.clear()
        while env.agents:
            _, gained, *_ = env.step({})
            fog, k = episode.world.truth.fog, episode.world.tick - 1
            ages.append((fog.mean(k) * 0.5, fog.mfow(k) * 0.5))
            rewards.append(gained["r1"])
        before = [0.0, *(mean for mean, _ in ages)]
        expected = {
            "mean": [-mean for mean, _ in ages],
            "mfow": [-mfow for _, mfow in ages],
            "change": [last - mean for last, (mean, _) in zip(before, ages, strict=False)],
        }
        assert rewards == pytest.approx(expected[reward])
        assert len(rewards) == 80


def test_a_reward_of_ones_own_takes_the_records_of_two_ticks() -> None:
    env = parallel_env(FLEET, reward=lambda before, record, step: record.k * step + (before is None))
    env.reset()
    assert [env.step({})[1]["r2"] for _ in range(3)] == [1.0, 0.5, 1.0]


def test_an_episode_knows_nothing_of_the_one_before() -> None:
    env = parallel_env(FLEET, reward=lambda before, _record, _step: float(before is None))
    for _ in range(2):
        _, infos = env.reset(seed=3)
        assert [infos["r1"][fact] for fact in ("ticks", "mfow_s", "mean_age_s")] == [0, 0.0, 0.0]
        assert [env.step({})[1]["r1"] for _ in range(3)] == [1.0, 0.0, 0.0]


def test_robots_see_what_they_believe_and_not_the_truth() -> None:
    """A robot that hears no position believes that nobody but itself has seen anything."""
    deaf = parallel_env({**FLEET, "faults": [{"kind": "loss", "rate": 1.0}]}, inputs=["fog", "heard"], window=101)
    heard = parallel_env(FLEET, inputs=["fog", "heard"], window=101)
    seen = []
    for env in (deaf, heard):
        observations, _ = env.reset()
        for _ in range(10):
            observations, *_ = env.step({})
        parts = observations["r1"]
        seen.append(int((parts["fog"][0] == 0.0).sum()))
        assert bool(parts["heard"].any()) == (env is heard)
        assert env.episode is not None
        mind_ages = env.episode.views[1].age
        assert float(parts["fog"][0].max()) == 1.0 == mind_ages.max() / env.episode.views[1].mfow
    assert seen[0] < seen[1]


def test_the_rewards_of_all_ticks_of_a_step_add_up() -> None:
    env = parallel_env(FLEET, actions="node", decide="arrival", reward=lambda *_: 1.0)
    rng = np.random.default_rng(1)
    observations, _ = env.reset()
    ticks = []
    for _ in range(6):
        observations, rewards, _, _, infos = env.step(drawn(env, observations, rng))
        ticks.append(infos["r1"]["ticks"])
        assert rewards["r1"] == ticks[-1]
    assert max(ticks) > 1


def test_arrival_steps_until_a_robot_decides() -> None:
    env = parallel_env({**FLEET, "duration": 400.0}, actions="node", decide="arrival")
    rng = np.random.default_rng(1)
    observations, infos = env.reset()
    assert all(info["active"] for info in infos.values())
    ticks = []
    while env.agents:
        actions = drawn(env, observations, rng)
        observations, _, _, ended, infos = env.step(actions)
        ticks.append(infos["r1"]["ticks"])
        assert any(info["active"] for info in infos.values()) or all(ended.values())
    assert sum(ticks) == 800
    assert max(ticks) > 5


def test_each_episode_has_the_next_seed_unless_one_is_given() -> None:
    env = parallel_env(FLEET)
    seeds = []
    for seed in (None, None, 8, None):
        env.reset(seed=seed)
        seeds.append(env.scenario.seed)
    assert seeds == [3, 4, 8, 9]


def test_the_same_space_is_given_each_time_and_each_agent_has_its_own_and_none_else_is_known() -> None:
    env = parallel_env(FLEET)
    assert env.action_space("r1") is env.action_space("r1")
    assert env.observation_space("r1") is env.observation_space("r1")
    assert env.action_space("r1") is not env.action_space("r2")
    env.reset()
    with pytest.raises(BadInput, match="nobody: no such agent; these are r1, r2, r3"):
        env.step({"nobody": 0})


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"window": 4}, "even"),
        ({"decide": "arrival"}, "a bearing leads to no place"),
        ({"inputs": ["smell"]}, "patrol.options.inputs"),
        ({"reward": "fame"}, "reward = 'fame': no such reward"),
        ({"overrides": {"radio.via": "direct", "pace": "realtime"}}, "in one process there is no network"),
    ],
)
def test_bad_settings_are_refused(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        parallel_env(FLEET, **settings)


def test_a_bearing_moves_the_robot_that_way_in_the_same_tick() -> None:
    env = parallel_env(FLEET)
    observations, _ = env.reset()
    assert env.episode is not None
    before = {number: view.pose for number, view in env.episode.views.items()}
    chosen = {agent: int(np.argmax(parts["action_mask"])) for agent, parts in observations.items()}
    env.step(chosen)
    for number, view in env.episode.views.items():
        across, up = view.pose.x - before[number].x, view.pose.y - before[number].y
        towards = math.atan2(up, across) - chosen[f"r{number}"] * math.pi / 4
        assert math.hypot(across, up) > 0.2 * view.stride
        assert math.cos(towards) > 0.9


@pytest.mark.parametrize(
    ("kind", "decide", "action"),
    [
        ("bearing", "tick", 9),
        ("bearing", "tick", -1),
        ("bearing", "tick", 2.7),
        ("bearing", "tick", None),
        ("place", "tick", 3),
        ("place", "tick", [float("nan"), 0.0]),
        ("place", "tick", [0.0, 0.0, 0.0]),
        ("node", "arrival", 10**6),
    ],
)
def test_an_action_outside_of_its_space_is_refused(kind: Any, decide: Any, action: Any) -> None:
    env = parallel_env(FLEET, actions=kind, decide=decide)
    env.reset()
    with pytest.raises(BadInput, match=r"action of r1 = .*: is not in "):
        env.step({"r1": action})


def test_arrays_of_one_number_and_seeds_of_numpy_are_taken_as_numbers() -> None:
    env = parallel_env(FLEET)
    hashes = []
    for action in (2, np.array([2]), np.int64(2)):
        env.reset(seed=np.int64(5))  # type: ignore[arg-type]
        env.step({"r1": action})
        assert env.episode is not None
        hashes.append(env.episode.trace_hash)
    assert len(set(hashes)) == 1


def test_an_error_of_a_robots_own_is_raised_and_not_a_robot_that_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    env = parallel_env(FLEET)
    env.reset()

    def fails(*_: object) -> None:
        raise ZeroDivisionError("none")

    monkeypatch.setattr("agent.learned.network.Decisions.intent", fails)
    with pytest.raises(RuntimeError, match="r1: ") as raised:
        env.step({"r1": 2})
    assert isinstance(raised.value.__cause__, ZeroDivisionError)
