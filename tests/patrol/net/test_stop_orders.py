from __future__ import annotations

import time

from patrol.net.link import Link, open_link
from patrol.net.stop_orders import Order, StopOrders, ask_robots
from tests.routers import PATIENCE_S, guarded_by_passwords

SHORT_S = 1.0


def asked(link: Link, keys: object, robot: str | None, order: Order) -> list[str]:
    return sorted(ask_robots(link, keys, robot, order, SHORT_S))  # type: ignore[arg-type]


def test_robots_obey_operators_and_nobody_else() -> None:
    obeyed: list[tuple[str, Order]] = []
    with guarded_by_passwords(["r1", "r2"]) as fleet:
        links = {
            user: open_link(fleet.router, PATIENCE_S, credentials=fleet.credentials[user])
            for user in ("robot-r1", "robot-r2", "operator", "viewer")
        }
        for robot in ("r1", "r2"):
            links[f"robot-{robot}"].live(fleet.keys.alive(robot))

            def carry_out(order: Order, robot: str = robot) -> str:
                obeyed.append((robot, order))
                return "stopped by an operator"

            StopOrders(links[f"robot-{robot}"], fleet.keys, robot).obey(carry_out)
        end = time.monotonic() + PATIENCE_S
        both = ["r1: stopped by an operator", "r2: stopped by an operator"]
        while asked(links["operator"], fleet.keys, None, Order.STOP) != both:
            assert time.monotonic() < end
        obeyed.clear()
        assert asked(links["operator"], fleet.keys, "r2", Order.RELEASE) == ["r2: stopped by an operator"]
        for other in ("viewer", "robot-r1"):
            assert asked(links[other], fleet.keys, "r2", Order.STOP) == []
        links["operator"].ask(fleet.keys.stop("r1"), b"jump", SHORT_S)
        links["operator"].ask(fleet.keys.stop("r1"), bytes(1000), SHORT_S)
        assert asked(links["operator"], fleet.keys, "r1", Order.STOP) == both[:1]
        assert obeyed == [("r2", Order.RELEASE), ("r1", Order.STOP)]
        for link in links.values():
            assert link.close(PATIENCE_S)
