# SPDX-License-Identifier: Apache-2.0
"""What is said of our formats, from the models that read them: JSON schemas of every YAML file, by
which editors complete, and tables of docs/."""
