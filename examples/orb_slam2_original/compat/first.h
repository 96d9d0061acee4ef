// SPDX-License-Identifier: Apache-2.0
// Included before everything else: what ORB-SLAM2's sources of 2016 take from headers that no
// longer bring it.
#pragma once

#include <unistd.h>

#include <opencv2/core/core_c.h>
#include <opencv2/imgcodecs/legacy/constants_c.h>
#include <opencv2/imgproc/types_c.h>
