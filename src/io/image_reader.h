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
  std::vector<SkippedKeyframe> skipped;   ///< keyframes before it that turned out to have no image
};

/// Decodes one image after the other. One that cannot be decoded costs its keyframe, not the run.
class PMSP_API Decoder {
 public:
  explicit Decoder(ImageSource& source) : source_(source), listed_(source.skipped().size()) {}

  Decoded next();

  /// Why the first of the images that could not be decoded could not; "" when all could.
  const std::string& first_error() const { return first_error_; }

 private:
  bool take_image(Decoded& decoded);
  void take_skipped(Decoded& decoded);

  ImageSource& source_;
  std::size_t listed_;     ///< of the source's skipped keyframes
  std::size_t asked_ = 0;  ///< of the source's keyframe_ids
  std::string first_error_;
};

/// Restricts a source to the images of a calibration, at most 24 (keyframes_for_lens_distance); of a video to as many
/// of its beginning, since all frames before the last one are decoded. Before the first `next`.
void restrict_to_sample(ImageSource& source);

/// How many images may be decoded ahead by so many threads: as many as take 512 MiB, but two at least.
PMSP_API int images_ahead(const SlamMap& map, int threads);

/// Decodes and verifies the next image, and takes its keyframe from the map, on a thread of its own, while whoever asks
/// works on one.
class PMSP_API ImageReader {
 public:
  /// Begins at once. Nothing else may ask the source meanwhile. `threads`: that decode. `verifier`: nullptr = images
  /// are not compared with the map.
  ImageReader(ImageSource& source, const SlamMap& map, int threads, PairingVerifier* verifier);
  ~ImageReader();
  ImageReader(const ImageReader&) = delete;
  ImageReader& operator=(const ImageReader&) = delete;

  struct Read : Decoded {
    Keyframe keyframe;                                ///< that the image belongs to, with it; the mask is left out
    std::optional<PairingVerifier::Verdict> pairing;  ///< of the images so far
  };
  /// Not after the last image, or after it threw. Throws InvalidInput where the images so far evidently belong to other
  /// keyframes, or the map lacks one's keyframe.
  Read next();

  /// The thread gives the image's memory back, which takes a while.
  void let_go(ImageSource::Item item);

  /// When there is no image any more: as Decoder::first_error.
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
  std::thread thread_;  ///< after all that it uses
};

/// A pass over images, one after the other, while other threads decode the next ones.
struct PMSP_API ImageLoop {
  ImageReader& images;
  std::function<void(std::size_t index, Keyframe& keyframe)> visit;  ///< with the image, without mask and prior depth
  std::function<void(const SkippedKeyframe&)> skipped = {};          ///< before the next image
  std::function<void()> check = {};      ///< before and after each image; what it throws ends the pass
  std::function<void(bool)> waits = {};  ///< true before, false after a wait for an image

  struct End {
    std::size_t images = 0;
    std::string first_error;  ///< why the first one cannot be read, where none can
    std::optional<PairingVerifier::Verdict> pairing;
  };
  /// Throws as ImageReader::next, and what the members throw.
  End operator()() const;
};

}  // namespace pmsp::io
