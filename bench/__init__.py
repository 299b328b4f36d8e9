"""Benchmarks: scripts on pyperf, which are no part of what is installed and run in a clone.

    python -m bench.kernels                              the kernels, beside other libraries (make rivals installs them)
    python -m bench.decisions                            one decision of one robot
    python -m bench.fleets                               a fleet in one process: processor time per robot and tick
    python -m bench.processes                            a fleet of processes: wall time per tick, memory
    python -m bench.router                               what a router spends on a delivery
    python -m bench.rivals                               how far other libraries' results agree with ours
    python -m bench.table FILE...                        a table of results, with ratios to ours

pyperf takes care of processes, warm-up, repeats and statistics. All scripts that measure have its options: ``--fast``
for rough answers, ``-p 1`` for one process, ``-o FILE`` for the results as JSON, ``--append FILE`` to add to them.
``--only TEXT`` takes only benchmarks whose name contains a text. ``python -m pyperf compare_to OLD NEW`` compares two
states of the code.

Times are processor times of all threads of a process, unless the name says wall. A benchmark's name is ``TASK:
CONTENDER`` where several contenders do the same task. To spread them over the same minutes, run a script several times
with ``--append``.
"""
