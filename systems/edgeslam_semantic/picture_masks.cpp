// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/picture_masks.hpp"

namespace slambed {

PictureMasks::PictureMasks(EdgeNode& node, PictureMasksOptions options)
    : node_(node),
      options_(options),
      segmentation_(node, options.floor),
      asked_(node.runtime()),
      answers_(node.runtime()) {}

void PictureMasks::start() {
  node_.runtime().spawn("nrcc", [this](Worker& worker) { work(worker); });
}

void PictureMasks::ask(std::uint64_t frame, wire::Bytes jpeg, RunTime since) {
  asked_.put({frame, std::move(jpeg), since});
}

void PictureMasks::work(Worker& worker) {
  while (const auto picture = asked_.take(worker)) {
    Answer answer;
    if (auto found = segmentation_.run(worker, picture->frame, picture->jpeg, options_.threshold)) {
      answer.segmented = true;
      answer.masks = std::move(*found);
    }
    answer.took = worker.now() - picture->since;
    answers_.put(std::move(answer));
  }
}

PictureMasks::Answer PictureMasks::wait(Worker& worker) {
  auto answer = answers_.take(worker);
  return answer ? std::move(*answer) : Answer{};  // no answer: the run stops
}

std::shared_ptr<const FeatureSet> PictureMasks::cull(Worker& worker,
                                                     std::shared_ptr<const FeatureSet> features,
                                                     const FrameMasks& masks) const {
  if (masks.instances.empty()) return features;
  return worker.stage("cull_features", [&](StageUnits& units) {
    units.n1 = features->size();
    return select(*features, features_off_masks(*features, masks, options_.border_px));
  });
}

}  // namespace slambed
