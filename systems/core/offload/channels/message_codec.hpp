// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string_view>

#include "features/vocabulary.hpp"
#include "map/map.hpp"
#include "node/messaging.hpp"
#include "node/parameters.hpp"
#include "runtime/channel.hpp"
#include "wire/direct_text.hpp"
#include "wire/messages.hpp"
#include "wire/reloc_messages.hpp"

namespace slambed {

/// Encodes keyframes, updates and frames, either in our checked binary form or as Edge-SLAM's text
/// archives, which reproduce their cost. Live, text goes through C++ streams; in virtual time a
/// model charges for that and the text is made directly. Stages: serialize and parse, or
/// serialize_text and parse_text; n1 is kilobytes. Copies share one cache of texts.
class MessageCodec {
 public:
  enum class Form { kBinary, kCompatibility };

  MessageCodec() = default;
  explicit MessageCodec(Form form);

  bool text() const { return form_ == Form::kCompatibility; }
  std::string_view parse_stage() const { return text() ? "parse_text" : "parse"; }

  /// local: the map that holds the keyframe and the points it sees.
  Bytes serialize(Worker& worker, const wire::KeyFrameMessage& message, const Map& local) const;
  Bytes serialize(Worker& worker, const wire::MapUpdate& message) const;
  Bytes serialize(Worker& worker, const wire::FrameMessage& message) const;
  Bytes serialize(Worker& worker, const wire::RelocRequest& message) const;
  /// asked: the frame of the request that the message answers.
  Bytes serialize(Worker& worker, const wire::RelocOk& message,
                  const wire::FrameMessage& asked) const;

  /// All throw wire::DecodeError. The caller runs them inside the stage parse_stage().
  wire::KeyFrameMessage keyframe(const Worker& worker, const Bytes& bytes,
                                 const wire::SensorPtr& sensor) const;
  wire::MapUpdate update(const Worker& worker, const Bytes& bytes,
                         const wire::SensorPtr& sensor) const;
  wire::FrameMessage frame(const Worker& worker, const Bytes& bytes,
                           const wire::SensorPtr& sensor) const;
  wire::RelocRequest request(const Worker& worker, const Bytes& bytes,
                             const wire::SensorPtr& sensor) const;
  wire::RelocOk found(const Worker& worker, const Bytes& bytes,
                      const wire::SensorPtr& sensor) const;

 private:
  template <typename Write>
  Bytes staged(Worker& worker, Write write) const;
  template <typename Message, typename... Others>
  Bytes written(Worker& worker, const Message& message, const Others&... others) const;
  template <typename Text, typename Binary>
  auto read(const Worker& worker, const Bytes& bytes, const wire::SensorPtr& sensor, Text from_text,
            Binary from_binary) const;
  /// Returns null when text goes through streams.
  wire::DirectText* direct(const Worker& worker) const;

  Form form_ = Form::kBinary;
  std::shared_ptr<const Vocabulary> vocabulary_;  ///< for the bags of words in text archives
  /// The cache of texts needs no lock: only charged workers use it, and they run one at a time.
  std::shared_ptr<wire::DirectText> direct_;
};

/// Returns whether the parameter `codec` selects Edge-SLAM's text archives.
bool writes_text(const Parameters& parameters);
/// Call it once per node: a node often reads back what it wrote, which the cache makes cheap.
MessageCodec message_codec(const Parameters& parameters);

}  // namespace slambed
