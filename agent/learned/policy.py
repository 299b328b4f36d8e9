"""The policy `learned`: a trained network that decides.

patrol: {policy: learned, options: {weights: trained.npz, inputs: [sectors]}}
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from agent.learned.network import Decisions, action_of, flattened, read_network

if TYPE_CHECKING:
    from agent.ports import Intent, PolicySetup
    from agent.view import View


class Learned:
    """Asks a network whenever a decision is due."""

    def __init__(self, setup: PolicySetup) -> None:
        """Read the network, or raise `BadInput` where there is none that can be used."""
        options = setup.options
        content = options.read_weights()
        self._decisions = Decisions(setup, options)
        choices = self._decisions.choices
        outputs = 2 if choices is None else choices
        self._network = read_network(content, Path(options.weights), self._decisions.observer.size, outputs)

    def decide(self, view: View) -> Intent:
        """Go on as decided before, or decide anew."""
        decisions = self._decisions
        if decisions.is_due(view):
            outputs = self._network(flattened(decisions.observe(view)))
            decisions.take(action_of(outputs, decisions.mask(view)), view)
        return decisions.intent(view)
