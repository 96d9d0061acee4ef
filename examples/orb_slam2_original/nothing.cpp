// SPDX-License-Identifier: Apache-2.0
// ORB-SLAM2's viewer and map drawer, without a window: they are asked and do nothing.
#include "MapDrawer.h"
#include "Viewer.h"

namespace ORB_SLAM2 {

MapDrawer::MapDrawer(Map* map, const std::string&) : mpMap(map) {}
void MapDrawer::SetCurrentCameraPose(const cv::Mat&) {}
void MapDrawer::SetReferenceKeyFrame(KeyFrame*) {}

Viewer::Viewer(System*, FrameDrawer*, MapDrawer*, Tracking*, const std::string&) {}
void Viewer::Run() {}
void Viewer::RequestFinish() {}
void Viewer::RequestStop() {}
bool Viewer::isFinished() { return true; }
bool Viewer::isStopped() { return true; }
void Viewer::Release() {}

}  // namespace ORB_SLAM2
