# SPDX-License-Identifier: Apache-2.0
"""Describes our formats from the models that read them: JSON schemas of every YAML file, for
editors, and tables of docs/."""
