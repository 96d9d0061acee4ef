// SPDX-License-Identifier: Apache-2.0
// Written from system.yaml by 'python -m slambed.document': change that file.
#pragma once

#include "node/parameters.hpp"

namespace slambed::edgeslam_semantic {

// clang-format off
inline std::vector<ParameterSpec> parameter_specs() {
  return {
      ParameterSpec::integer("n_orb", 50, 10000),
      ParameterSpec::integer("jpeg_quality", 1, 100),
      ParameterSpec::integer("offload_window", 0, 1000),
      ParameterSpec::integer("picture_queue", 1, 10000),
      ParameterSpec::boolean("nrcc"),
      ParameterSpec::real("n_m", 0, 1),
      ParameterSpec::integer("mask_border_px", 0, 100),
      ParameterSpec::real("nrcc_floor_ms", 0, 10000),
      ParameterSpec::boolean("loop_closing"),
      ParameterSpec::boolean("second_hypotheses"),
      ParameterSpec::boolean("full_offload"),
      ParameterSpec::boolean("adapt"),
      ParameterSpec::integer("fixed_row", 0, 5),
      ParameterSpec::choice("table_n_m", {"0.8 0.7 0.6"}),
      ParameterSpec::boolean("delay_one_way"),
      ParameterSpec::real("probe_period_s", 0.01, 60),
      ParameterSpec::integer("keyframes_under_way", 0, 1000),
      ParameterSpec::integer("upload_queue", 1, 1000),
      ParameterSpec::boolean("local_references"),
      ParameterSpec::integer("local_keyframes", 2, 1000),
      ParameterSpec::integer("local_neighbors", 1, 100),
      ParameterSpec::integer("label_frames", 1, 10000),
      ParameterSpec::integer("label_neighbors", 0, 100),
      ParameterSpec::real("label_reach_px", 1, 1000),
      ParameterSpec::boolean("record_culling"),
  };
}
// clang-format on

}  // namespace slambed::edgeslam_semantic
