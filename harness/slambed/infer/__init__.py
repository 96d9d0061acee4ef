# SPDX-License-Identifier: Apache-2.0
"""What a paper leaves open, fitted on one of its tables and predicting the others."""
