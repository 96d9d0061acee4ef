# SPDX-License-Identifier: Apache-2.0
"""JSON schemas of every YAML file, from the models that read them: editors complete by these."""
