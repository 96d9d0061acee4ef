// SPDX-License-Identifier: Apache-2.0
// OpenCV 4 has no such header any more.
#pragma once

#include <opencv2/opencv.hpp>
