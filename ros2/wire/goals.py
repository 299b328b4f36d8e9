"""The action NavigateToPose of Nav2, from both sides: a client that sends a robot somewhere, and the robot's server.

An action is three services (send_goal, get_result, cancel_goal) and two topics (feedback, status). Neither side waits:
its user calls its `step` now and then.
"""

from __future__ import annotations

import math
import os
from collections import deque
from dataclasses import dataclass
from enum import Enum, IntEnum

from ros2.wire.definitions import CANCEL_GOAL, GET_RESULT, SEND_GOAL
from ros2.wire.mailbox import RosMailbox
from ros2.wire.messages import (
    CancelRequest,
    CancelResponse,
    Feedback,
    GetResultRequest,
    GetResultResponse,
    GoalStatusArray,
    PoseStamped,
    SendGoalRequest,
    SendGoalResponse,
)
from ros2.wire.names import LATCHED, USUAL
from ros2.wire.ports import Asked, Ros2Link, Service

NAME = "navigate_to_pose"
"""The name of Nav2's action, relative to the robot's namespace."""

ACCEPT_S = 5.0
"""Longest time for a robot to accept a goal, s."""
RESULT_S = 30.0
"""Time without a result after which it is asked for again, s."""

CANCEL_S = 0.25
"""Time between two requests to cancel while none is confirmed, s."""
CANCEL_LIMIT_S = 2.0
"""Time for which the answer to one of them counts, s."""

_SEND = Service(SEND_GOAL, SendGoalRequest, SendGoalResponse)
_RESULT = Service(GET_RESULT, GetResultRequest, GetResultResponse)
_CANCEL = Service(CANCEL_GOAL, CancelRequest, CancelResponse)
_ANY_GOAL = bytes(16)
# Clients that never come back for their results must not fill the memory.
_ROOM = 32
_MOST_GOALS = 16
_NO_GOAL_LEFT = frozenset({0, 2, 3})
"""Codes of action_msgs/CancelGoal: cancelled or nothing to cancel, no such goal, ended already. 1 means refused."""


class Status(IntEnum):
    """The state of a goal, by the numbers of action_msgs/GoalStatus."""

    UNKNOWN = 0
    ACCEPTED = 1
    EXECUTING = 2
    CANCELING = 3
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6

    @property
    def over(self) -> bool:
        """True if nothing more will happen to the goal."""
        return self >= Status.SUCCEEDED


class Going(Enum):
    """The state of a robot that was sent somewhere."""

    NOWHERE = "nowhere"
    ASKED = "asked"
    UNDER_WAY = "under way"
    THERE = "there"
    FAILED = "failed"
    STOPPING = "stopping"
    STOPPED = "stopped"


class GoalClient:
    """Sends a robot somewhere. A new goal takes the place of the last one, as in Nav2."""

    def __init__(self, link: Ros2Link, name: str = NAME) -> None:
        self._link = link
        self._name = f"{name}/_action"
        self._goal = _ANY_GOAL
        self._accepted: RosMailbox[SendGoalResponse] | None = None
        self._result: RosMailbox[GetResultResponse] | None = None
        self._asked_s = 0.0
        self._cancels: deque[RosMailbox[CancelResponse]] = deque(maxlen=round(CANCEL_LIMIT_S / CANCEL_S))
        self._cancelled_s = -math.inf
        self.going = Going.NOWHERE

    def go(self, target: PoseStamped, now_s: float) -> None:
        """Send the robot somewhere."""
        self._goal = os.urandom(16)
        request = SendGoalRequest(self._goal, target)
        self._accepted = self._link.call(f"{self._name}/send_goal", _SEND, request, ACCEPT_S)
        self._result = None
        self._asked_s = now_s
        self.going = Going.ASKED

    def stop(self, now_s: float) -> None:
        """Cancel every goal that the robot has, also those of others: a robot that is to stop stops.

        `step` repeats the request until the robot confirms it; until then it is stopping.
        """
        self._result = None
        self._cancels.clear()
        self._cancelled_s = -math.inf
        self.going = Going.STOPPING
        self.step(now_s)

    def step(self, now_s: float) -> Going:
        """Take in the robot's answers."""
        if self.going is Going.STOPPING:
            self._step_stop(now_s)
            return self.going
        waited_s = now_s - self._asked_s
        if self._accepted is not None:
            if (answer := self._accepted.take()) is not None:
                self._accepted = None
                self.going = Going.UNDER_WAY if answer.message.accepted else Going.FAILED
                self._ask_result(now_s)
            elif waited_s > ACCEPT_S:
                self._accepted = None
                self.going = Going.FAILED
        elif self._result is not None:
            if (result := self._result.take()) is not None:
                self._result = None
                self.going = Going.THERE if result.message.status == Status.SUCCEEDED else Going.FAILED
            elif waited_s > RESULT_S:
                self._ask_result(now_s)
        return self.going

    def _step_stop(self, now_s: float) -> None:
        """Cancel until the robot confirms a request that it got after it had decided on our last goal.

        A request that overtakes a goal cancels nothing, and the goal is accepted after it.
        """
        if self._accepted is not None:
            if self._accepted.take() is not None or now_s - self._asked_s > ACCEPT_S:
                self._accepted = None
            self._cancels.clear()
        answers = [answer for cancel in self._cancels if (answer := cancel.take()) is not None]
        if any(answer.message.code in _NO_GOAL_LEFT for answer in answers):
            self.going = Going.STOPPED
        elif now_s - self._cancelled_s >= CANCEL_S:
            self._cancelled_s = now_s
            request = CancelRequest(_ANY_GOAL)
            self._cancels.append(self._link.call(f"{self._name}/cancel_goal", _CANCEL, request, CANCEL_LIMIT_S))

    def _ask_result(self, now_s: float) -> None:
        if self.going is Going.UNDER_WAY:
            self._asked_s = now_s
            self._result = self._link.call(f"{self._name}/get_result", _RESULT, GetResultRequest(self._goal), RESULT_S)


@dataclass(slots=True)
class _Goal:
    target: PoseStamped
    status: Status


class GoalServer:
    """Goes where it is sent, one goal at a time: a new goal aborts the last one."""

    def __init__(self, link: Ros2Link, name: str = NAME) -> None:
        inside = f"{name}/_action"
        self._goals: dict[bytes, _Goal] = {}
        self._current = _ANY_GOAL
        self._sent: RosMailbox[Asked[SendGoalRequest, SendGoalResponse]] = RosMailbox(_ROOM)
        self._wanted: RosMailbox[Asked[GetResultRequest, GetResultResponse]] = RosMailbox(_ROOM)
        self._cancels: RosMailbox[Asked[CancelRequest, CancelResponse]] = RosMailbox(_ROOM)
        self._waiting: list[Asked[GetResultRequest, GetResultResponse]] = []
        link.serve(f"{inside}/send_goal", _SEND, self._sent)
        link.serve(f"{inside}/get_result", _RESULT, self._wanted)
        link.serve(f"{inside}/cancel_goal", _CANCEL, self._cancels)
        self._feedback = link.publisher(f"{inside}/feedback", Feedback, USUAL)
        self._status = link.publisher(f"{inside}/status", GoalStatusArray, LATCHED)

    @property
    def target(self) -> PoseStamped | None:
        """The present goal; None for none."""
        goal = self._goals.get(self._current)
        return None if goal is None or goal.status.over else goal.target

    def step(self, stamp_ns: int) -> PoseStamped | None:
        """Take in requests, and return where to go now; None for nowhere."""
        while (sent := self._sent.take()) is not None:
            self._accept_goal(sent.message, stamp_ns)
        while (cancel := self._cancels.take()) is not None:
            self._cancel_goals(cancel.message)
        while (wanted := self._wanted.take()) is not None:
            self._waiting = [*self._waiting, wanted.message][-_ROOM:]
        self._answer_results()
        return self.target

    def finish(self, status: Status) -> None:
        """End the present goal, if there is one, as succeeded or aborted."""
        self._end_goal(self._current, status)

    def feedback(self, current: PoseStamped, elapsed_s: float, distance_left: float) -> None:
        """Publish the progress towards the present goal, if there is one; `distance_left` is in m."""
        if self.target is not None:
            self._feedback.send(Feedback(self._current, current, elapsed_s, distance_left))

    def _accept_goal(self, asked: Asked[SendGoalRequest, SendGoalResponse], stamp_ns: int) -> None:
        request = asked.request
        fresh = request.goal_id not in self._goals and request.goal_id != _ANY_GOAL
        asked.answer(SendGoalResponse(fresh, stamp_ns))
        if not fresh:
            return
        self._end_goal(self._current, Status.ABORTED)
        self._current = request.goal_id
        self._goals[request.goal_id] = _Goal(request.target, Status.EXECUTING)
        while len(self._goals) > _MOST_GOALS:
            del self._goals[next(iter(self._goals))]
        self._tell_status()

    def _cancel_goals(self, asked: Asked[CancelRequest, CancelResponse]) -> None:
        wanted = asked.request.goal_id
        ended = self._current if self.target is not None and wanted in {_ANY_GOAL, self._current} else None
        asked.answer(CancelResponse(0, (ended,)) if ended is not None else CancelResponse(2))
        if ended is not None:
            self._end_goal(ended, Status.CANCELED)

    def _end_goal(self, identity: bytes, status: Status) -> None:
        goal = self._goals.get(identity)
        if goal is not None and not goal.status.over:
            goal.status = status
            self._tell_status()
            self._answer_results()

    def _answer_results(self) -> None:
        waiting = []
        for question in self._waiting:
            goal = self._goals.get(question.request.goal_id)
            if goal is not None and not goal.status.over:
                waiting.append(question)
            else:
                question.answer(GetResultResponse(Status.UNKNOWN if goal is None else goal.status))
        self._waiting = waiting

    def _tell_status(self) -> None:
        self._status.send(GoalStatusArray(tuple((identity, goal.status) for identity, goal in self._goals.items())))
