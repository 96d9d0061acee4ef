// SPDX-License-Identifier: Apache-2.0
// ORB-SLAM2 (Mur-Artal and Tardos, T-RO 2017) as its authors published it, played by slambed-play.
// Usage, by slambed only: orb_slam2 VOCABULARY
#include <slambed_client.h>
#include <time.h>

#include <Eigen/Geometry>
#include <fstream>
#include <opencv2/core.hpp>
#include <string>

#include "System.h"

namespace {

using ORB_SLAM2::System;

double seconds(const timespec& time) { return double(time.tv_sec) + 1e-9 * double(time.tv_nsec); }

double cpu_s(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return seconds(now);
}

std::string param(const char* name) { return slambed_param(name); }

/// What ORB-SLAM2 reads about camera and features.
void write_settings(const slambed_info& info, const std::string& path) {
  std::ofstream out(path);
  out.precision(12);
  const char* distortion[] = {"k1", "k2", "p1", "p2", "k3"};
  out << "%YAML:1.0\n"
      << "Camera.fx: " << info.fx << "\nCamera.fy: " << info.fy << "\nCamera.cx: " << info.cx
      << "\nCamera.cy: " << info.cy << "\nCamera.width: " << info.width
      << "\nCamera.height: " << info.height << "\nCamera.fps: " << info.fps
      << "\nCamera.RGB: 1\nCamera.bf: " << info.bf << "\n";
  for (int i = 0; i < 5; ++i)
    out << "Camera." << distortion[i] << ": " << std::fixed << info.distortion[i] << "\n";
  out << std::defaultfloat << "ThDepth: " << param("TH_DEPTH") << "\n";
  if (info.depth_unit_m > 0) out << "DepthMapFactor: " << 1.0 / info.depth_unit_m << "\n";
  out << "ORBextractor.nFeatures: " << param("N_ORB") << "\nORBextractor.scaleFactor: 1.2\n"
      << "ORBextractor.nLevels: 8\nORBextractor.iniThFAST: 20\nORBextractor.minThFAST: 7\n";
}

System::eSensor sensor_of(const slambed_info& info) {
  switch (info.sensor) {
    case SLAMBED_RGBD:
      return System::RGBD;
    case SLAMBED_STEREO:
      return System::STEREO;
    default:
      return System::MONOCULAR;
  }
}

cv::Mat track(System& slam, const slambed_client& client, const slambed_frame& frame) {
  const auto picture = [&](const void* pixels, int type) {
    return cv::Mat(int(client.info.height), int(client.info.width), type,
                   const_cast<void*>(pixels));
  };
  const cv::Mat grey = picture(slambed_grey(&client, &frame), CV_8UC1);
  // The number of the frame in place of its time, which tracking does not use: it comes back in
  // the trajectory.
  const double number = double(frame.index);
  switch (sensor_of(client.info)) {
    case System::RGBD:
      return slam.TrackRGBD(grey, picture(slambed_second(&client, &frame), CV_16UC1), number);
    case System::STEREO:
      return slam.TrackStereo(grey, picture(slambed_second(&client, &frame), CV_8UC1), number);
    default:
      return slam.TrackMonocular(grey, number);
  }
}

slambed_pose told(System& slam, const slambed_frame& frame, const cv::Mat& T_cw) {
  // Of Tracking::eTrackingState; a lost frame may have a pose too, which is none.
  constexpr int kNotInitialised = 1;
  constexpr int kOk = 2;
  const int state = slam.GetTrackingState();
  if (state <= kNotInitialised) return slambed_untracked(&frame, SLAMBED_NOT_INITIALISED);
  if (state != kOk || T_cw.empty()) return slambed_untracked(&frame, SLAMBED_LOST);
  Eigen::Matrix4d pose;
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) pose(row, column) = T_cw.at<float>(row, column);
  const Eigen::Quaterniond q_wc(pose.topLeftCorner<3, 3>().transpose());
  const Eigen::Vector3d t_wc = -(q_wc * pose.topRightCorner<3, 1>());
  slambed_pose out = slambed_tracked(&frame, t_wc.data(), q_wc.normalized().coeffs().data());
  out.features = int(slam.GetTrackedKeyPointsUn().size());
  out.inliers = 0;
  for (const auto* point : slam.GetTrackedMapPoints()) out.inliers += point != nullptr;
  return out;
}

/// The trajectory as the finished map has it; ORB-SLAM2 writes none for a single camera.
void send_final(slambed_client& client, const std::string& path) {
  std::ifstream in(path);
  double number = 0;
  double t[3];
  double q[4];
  while (in >> number >> t[0] >> t[1] >> t[2] >> q[0] >> q[1] >> q[2] >> q[3]) {
    slambed_frame frame{};
    frame.index = uint64_t(number + 0.5);
    const slambed_pose pose = slambed_tracked(&frame, t, q);
    slambed_send_final(&client, &pose);
  }
}

int keyframes_in(const std::string& path) {
  std::ifstream in(path);
  int lines = 0;
  for (std::string line; std::getline(in, line);) ++lines;
  return lines;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: orb_slam2 VOCABULARY\n");
    return 2;
  }
  slambed_client client;
  if (slambed_open(&client) != 0) return 1;
  const std::string folder = getenv("SLAMBED_OUTPUT");
  write_settings(client.info, folder + "/settings.yaml");
  System slam(argv[1], folder + "/settings.yaml", sensor_of(client.info), false);
  slambed_ready(&client);

  const double others_before = cpu_s(CLOCK_PROCESS_CPUTIME_ID) - cpu_s(CLOCK_THREAD_CPUTIME_ID);
  slambed_frame frame;
  while (slambed_next(&client, &frame) == 1) {
    const double begin = cpu_s(CLOCK_THREAD_CPUTIME_ID);
    const slambed_pose pose = told(slam, frame, track(slam, client, frame));
    slambed_send_pose(&client, &pose);
    const std::string spent = std::to_string(1e3 * (cpu_s(CLOCK_THREAD_CPUTIME_ID) - begin));
    slambed_send_event(&client,
                       (R"({"type": "frame_cpu", "track_cpu_ms": )" + spent + "}").c_str());
  }
  // Whatever was not tracking: mapping, and looking for loops, which is little.
  const double others =
      cpu_s(CLOCK_PROCESS_CPUTIME_ID) - cpu_s(CLOCK_THREAD_CPUTIME_ID) - others_before;
  slam.Shutdown();
  slam.SaveKeyFrameTrajectoryTUM(folder + "/keyframes.txt");
  const int keyframes = keyframes_in(folder + "/keyframes.txt");
  const std::string each = std::to_string(keyframes > 0 ? 1e3 * others / keyframes : 0.0);
  slambed_send_event(&client, (R"({"type": "map_made", "keyframes": )" + std::to_string(keyframes) +
                               R"(, "mapping_cpu_ms": )" + each + "}")
                                  .c_str());
  if (sensor_of(client.info) != System::MONOCULAR) {
    slam.SaveTrajectoryTUM(folder + "/final.txt");
    send_final(client, folder + "/final.txt");
  }
  slambed_close(&client);
  return 0;
}
