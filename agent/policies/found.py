"""The policy that a scenario names, with its options.

A policy is ``stochastic`` (the default), ``committed`` (the tour), ``potential-field`` (the paper's), ``learned`` (a
trained network), a rival from the literature, or one of one's own, found by name (`patrol.classes.named_class`). Only
what runs minds comes here: no command that only reads a run imports its policy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, cast

from agent.ports import Policy, PolicySetup
from patrol.classes.named_class import ClassSort, NamedClass, load
from patrol.errors import BadInput
from patrol.scenario import CommitmentOptions
from patrol.scenario.patrols import PAPER as PAPER_PATROL
from patrol.scenario.policies import COMMITTED, LEARNED, PAPER, STOCHASTIC
from patrol.values import Section

if TYPE_CHECKING:
    from patrol.scenario import Scenario

POLICIES = ClassSort(
    noun="policy",
    field="patrol.policy",
    call="decide(view)",
    group="fogwatch.policies",
    built_in=MappingProxyType(
        {
            COMMITTED: "agent.policies.stochastic:Committed",
            STOCHASTIC: "agent.policies.stochastic:Stochastic",
            PAPER: "agent.policies.potential_field:PotentialField",
            LEARNED: "agent.learned.network:Learned",
            "random": "experiments.rivals.conscientious:RandomWalk",
            "cr": "experiments.rivals.conscientious:ConscientiousReactive",
            "hcr": "experiments.rivals.conscientious:HeuristicConscientiousReactive",
            "hpcc": "experiments.rivals.conscientious:HeuristicPathfinder",
            "greedy": "experiments.rivals.conscientious:Greedy",
            "gbs": "experiments.rivals.bayesian:GreedyBayesian",
            "sebs": "experiments.rivals.bayesian:StateExchangeBayesian",
            "cbls": "experiments.rivals.bayesian:ConcurrentBayesianLearning",
            "er": "experiments.rivals.expected:ExpectedReactive",
            "mns": "experiments.rivals.expected:MinimalNetwork",
            "dtag": "experiments.rivals.assignment:GreedyAssignment",
            "dtap": "experiments.rivals.assignment:AuctionAssignment",
            "tour": "experiments.rivals.tours:Tour",
            "even-tour": "experiments.rivals.tours:EvenTour",
            "ahpa": "experiments.rivals.tours:VoronoiTours",
            "partition": "experiments.rivals.tours:PartitionTours",
        }
    ),
)


@dataclass(frozen=True, slots=True)
class PolicyKind:
    """A scenario's policy, as the scenario names it, and how one is made for a robot."""

    name: str
    make: Callable[[PolicySetup], Policy]
    options: Any  # the scenario's, as the policy's own model; an empty mapping where it has none
    ours: bool  # it comes with fogwatch, so that its failures are bugs

    @property
    def follows_rounds(self) -> bool:
        """True if it follows tours, or draws from their stations: by its options, or by its class's own word."""
        return isinstance(self.options, CommitmentOptions) or bool(getattr(self.make, "follows_rounds", False))


def policy_named(scenario: Scenario) -> NamedClass:
    """Return the policy as a scenario names it; nothing of it is imported."""
    patrol = scenario.patrol
    if patrol.policy == PAPER_PATROL:
        raise BadInput(f"patrol.policy = {patrol.policy}: this is a patrol; its policy is {PAPER} (or --patrol paper)")
    options = {} if isinstance(patrol.options, Section) else patrol.options or {}
    return NamedClass(POLICIES, patrol.policy, patrol.policy_sha256, options)


def policy_of(scenario: Scenario) -> PolicyKind:
    """Return the policy that a scenario names, with its options.

    It raises `BadInput` where the policy cannot be found or loaded, its file is not the one that the scenario was
    resolved with, or it does not take the options.
    """
    maker, options = load(named := policy_named(scenario))
    if isinstance(scenario.patrol.options, Section):  # they were checked with the scenario
        options = scenario.patrol.options
    return PolicyKind(
        named.name, cast(Callable[[PolicySetup], Policy], maker), options, named.name in POLICIES.built_in
    )
