# SPDX-License-Identifier: Apache-2.0
"""One file per family of figures; each draws from a Results and saves through a FigureWriter."""
