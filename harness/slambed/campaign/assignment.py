# SPDX-License-Identifier: Apache-2.0
"""Assigns runs to several hosts.

All cells of a repetition run on the same host, and the repetitions of each cell are spread evenly
over the hosts. Any effect of a host therefore hits all cells equally often, and values paired by
repetition come from one machine.
"""

import random


def preference(repetition: int, hosts: list[str], seed: int) -> list[str]:
    """Returns the host that executes this repetition, followed by its substitutes in order.

    Each block of as many repetitions as hosts uses every host once, in a seeded order. Adding
    repetitions does not change the hosts of earlier ones.
    """
    block, place = divmod(repetition, len(hosts))
    order = list(hosts)
    random.Random(f"{seed}/hosts/{block}").shuffle(order)
    return order[place:] + order[:place]
