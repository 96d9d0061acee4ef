# SPDX-License-Identifier: Apache-2.0
"""Figures, one file per family; each draws from Results and saves with a FigureWriter."""
