# SPDX-License-Identifier: Apache-2.0
"""What happened in one run, as a picture and in words; live and virtual runs alike."""
