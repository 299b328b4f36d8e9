"""The report's section about the radio: frames that were sent, that arrived, and the causes of losses."""

from __future__ import annotations

import numpy as np

from monitor.replay.run import Run
from monitor.report import html

MOST_LINKS = 400


def links_section(run: Run) -> str:
    """Describe the fates of the frames: counts, causes of loss, and a table of links.

    Of a direct radio, only the robots' reports are known.
    """
    if run.direct:
        return _direct_links(run)
    sent, lost = run.links.sent, run.links.lost
    if not sent.any():
        return html.text("No frames were sent.", "note")
    in_flight = sent - run.links.delivered - lost
    total, arrived, flying = (int(counts[1:].sum()) for counts in (sent, run.links.delivered, in_flight))
    sentences = [f"{arrived} of {total} frames were delivered (counted once for each receiver)."]
    if sent[0].any():
        sentences.append(f"{int(run.links.delivered[0].sum())} forged frames were delivered.")
    if flying:
        sentences.append(f"{flying} were still in flight at the end.")
    late = f"The largest delay was {run.links.late * run.step:g} s."
    sentences += [late if run.links.late else "All arrived in the tick in which they were sent."]
    sentences.append(f"Robots rejected {run.figures.messages.rejected} frames.")
    causes = [(why, *(str(int(of.sum())) for of in (c[1:], c[0]))) for why, c in run.links.dropped.items()]
    parts = [html.text(" ".join(sentences))]
    if causes:
        parts.append(html.table(("cause of loss", "frames", "forged frames"), causes, numbers=(1, 2)))
    names = ("forger", *run.names)
    rows = []
    for row, column in zip(*np.nonzero(sent), strict=True):
        delivered, number = int(run.links.delivered[row, column]), int(sent[row, column])
        why = ", ".join(f"{cause} {c[row, column]}" for cause, c in run.links.dropped.items() if c[row, column])
        settled = number - int(in_flight[row, column])
        share = f"{100.0 * delivered / settled:.2f}" if settled else "-"
        counts = (number, delivered, number - settled)
        rows.append((names[row], names[column], *map(str, counts), share, why))
    heads = ("from", "to", "sent", "delivered", "in flight", "delivered (%)", "cause of loss")
    return "".join([*parts, html.long_table("all links", heads, rows, range(2, 6), MOST_LINKS)])


def _direct_links(run: Run) -> str:
    """Describe a direct radio as robots reported it: how many frames they sent and heard."""
    why = "Robots heard each other directly, so the fate of single frames is unknown"
    direct = run.stated.direct
    if not direct.links:
        return html.text(f"{why}. No two robots reported at the end how many frames they sent and heard.", "note")
    sent, heard_frames = (sum(getattr(counts, end) for counts in direct.links.values()) for end in ("sent", "heard"))
    missing = ", ".join(direct.unsaid)
    unsaid = f" The counts of {missing} are missing or incomplete." if missing else ""
    rows = []
    for link, counts in direct.links.items():
        share = f"{100.0 * counts.heard / counts.sent:.2f}" if counts.sent else "-"
        rows.append((link, str(counts.sent), str(counts.heard), share))
    rejected = run.figures.messages.rejected
    counts_text = html.text(
        f"{why}. According to their reports they heard {heard_frames} of {sent} frames and rejected {rejected}.{unsaid}"
    )
    return counts_text + html.long_table(
        "all links", ("link", "sent", "heard", "heard (%)"), rows, range(1, 4), MOST_LINKS
    )
