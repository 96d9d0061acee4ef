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

/// How keyframes, updates and frames are written: our checked binary form, or the text archives of
/// Edge-SLAM, for what they cost: by streams, unless a model charges for it. Stages: serialize and
/// parse, or serialize_text and parse_text; n1 is kilobytes. Copies share what they keep of texts.
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
  /// asked: the frame of the request.
  Bytes serialize(Worker& worker, const wire::RelocOk& message,
                  const wire::FrameMessage& asked) const;

  /// All throw wire::DecodeError. Within the stage parse_stage().
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
  /// Null: by streams.
  wire::DirectText* direct(const Worker& worker) const;

  Form form_ = Form::kBinary;
  std::shared_ptr<const Vocabulary> vocabulary_;  ///< text carries bags of words
  /// Of charged workers, which run one at a time.
  std::shared_ptr<wire::DirectText> direct_;
};

/// Whether the parameter codec asks for the text archives of Edge-SLAM.
bool writes_text(const Parameters& parameters);
/// One for a node: what it writes it is likely to read again.
MessageCodec message_codec(const Parameters& parameters);

}  // namespace slambed
