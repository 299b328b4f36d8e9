"""Faults over time, from the events of a journal."""

from monitor.observation.fault_bands import Band, bands_of, lanes
from patrol.journal.records import Event


def test_bands_last_from_their_beginning_to_their_end() -> None:
    events = [
        Event(2, "fault", None, "f1 loss begins: all to all, rate 0.5"),
        Event(4, "fault", None, "f2 kill happens: r1"),
        Event(4, "dead", 1, "f2 kill"),
        Event(6, "fault", None, "f1 loss ends"),
        Event(8, "fault", None, "f3 delay begins: all to all"),
        Event(9, "lost", 2, "its process ended"),
        Event(9, "fault", None, "who knows"),
    ]
    bands = bands_of(events, 0.5, 10.0)
    assert [(band.id, band.kind, band.begin, band.end) for band in bands] == [
        ("f1", "loss", 1.0, 3.0),
        ("f2", "kill", 2.0, 2.0),
        ("f3", "delay", 4.0, 10.0),
        ("", "lost", 4.5, 4.5),
    ]
    assert [band.lasts for band in bands] == [True, False, True, False]
    assert bands[0].text == "all to all, rate 0.5"
    assert [name for name, _ in lanes(bands, 8)] == ["f1 loss", "f2 kill", "f3 delay", "lost"]
    assert [name for name, _ in lanes(bands[:1] * 2 + bands[1:], 3)] == ["loss", "kill", "delay", "lost"]


def test_as_many_faults_as_there_may_be_have_a_row_each_whatever_their_kind() -> None:
    two = [Band("f1", "loss", 0.0, 1.0), Band("f2", "loss", 2.0, 3.0)]
    assert [name for name, _ in lanes(two, 2)] == ["f1 loss", "f2 loss"]
    assert lanes(two, 1) == [("loss", two)]
