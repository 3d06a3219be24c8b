// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "io/pairing.h"
#include "pmsp/api.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"

namespace pmsp::io {

struct Decoded {
  std::optional<ImageSource::Item> item;  ///< nullopt after the last image
  std::vector<SkippedKeyframe> skipped;   ///< keyframes before it without an image
};

/// Decodes images one after the other. Undecodable ones are skipped with their keyframes.
class PMSP_API Decoder {
 public:
  explicit Decoder(ImageSource& source) : source_(source), listed_(source.skipped().size()) {}

  Decoded next();

  /// Error of the first undecodable image; "" = none.
  const std::string& first_error() const { return first_error_; }

 private:
  bool take_image(Decoded& decoded);
  void take_skipped(Decoded& decoded);

  ImageSource& source_;
  std::size_t listed_;       ///< index into the source's skipped()
  std::size_t next_id_ = 0;  ///< index into the source's keyframe_ids
  std::string first_error_;
};

/// Restricts a source to the calibration images, at most 24 (keyframes_for_lens_distance); of a video to its first
/// ones, since all frames up to the last one are decoded. To be called before the first `next`.
void restrict_to_sample(ImageSource& source);

/// Returns the number of images that `threads` threads may decode ahead: up to 512 MiB, at least two.
PMSP_API int images_ahead(const SlamMap& map, int threads);

/// Decodes and verifies the next image on its own thread while the caller uses the current one, and supplies its
/// keyframe.
class PMSP_API ImageReader {
 public:
  /// Starts decoding; the source must not be used otherwise meanwhile. `threads`: for decoding. `verifier`: nullptr =
  /// images are not compared with the map.
  ImageReader(ImageSource& source, const SlamMap& map, int threads, PairingVerifier* verifier);
  ~ImageReader();
  ImageReader(const ImageReader&) = delete;
  ImageReader& operator=(const ImageReader&) = delete;

  struct Read : Decoded {
    Keyframe keyframe;                                ///< of the image; `image` is set, `mask` is not
    std::optional<PairingVerifier::Verdict> pairing;  ///< verdict on the images so far
  };
  /// Returns the next image; not to be called after the last one or an exception. Throws InvalidInput if the images so
  /// far belong to other keyframes, or a keyframe is missing in the map.
  Read next();

  /// Releases the image's memory on the thread, since that takes time.
  void release_async(ImageSource::Item item);

  /// See Decoder::first_error; valid after the last image.
  const std::string& first_error() const { return decoder_.first_error(); }

 private:
  void work();
  Read read();

  Decoder decoder_;
  const SlamMap& map_;
  PairingVerifier* verifier_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<Read> ready_;
  std::exception_ptr failed_;
  std::optional<ImageSource::Item> done_;
  bool stop_ = false;
  std::thread thread_;  ///< last member, since it uses the others
};

/// Pass over all images, with read-ahead.
struct PMSP_API ImageLoop {
  ImageReader& images;
  std::function<void(std::size_t index, Keyframe& keyframe)> visit;  ///< with the image, without mask and prior depth
  std::function<void(const SkippedKeyframe&)> skipped = {};          ///< called before the next image
  std::function<void()> check = {};      ///< called before and after each image; its exceptions end the pass
  std::function<void(bool)> waits = {};  ///< true before, false after waiting for an image

  struct End {
    std::size_t images = 0;
    std::string first_error;  ///< error of the first image, if none can be read
    std::optional<PairingVerifier::Verdict> pairing;
  };
  /// Throws as ImageReader::next and the members.
  End operator()() const;
};

}  // namespace pmsp::io
