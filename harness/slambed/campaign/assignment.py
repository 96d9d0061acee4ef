# SPDX-License-Identifier: Apache-2.0
"""Which host of several executes which run.

All cells of a repetition go to the same host, and the repetitions of every cell are spread over the
hosts as evenly as their number allows. So whatever a host does to its runs, it does to all cells
equally often, also where the repetitions are no multiple of the hosts, and what is paired by
repetition was made on one machine.
"""

import random


def preference(repetition: int, hosts: list[str], seed: int) -> list[str]:
    """The host that executes this repetition, and those that take its place in turn when it dies.

    As many repetitions as there are hosts have one each, in a seeded order; more repetitions later
    do not change which these are.
    """
    block, place = divmod(repetition, len(hosts))
    order = list(hosts)
    random.Random(f"{seed}/hosts/{block}").shuffle(order)
    return order[place:] + order[:place]
