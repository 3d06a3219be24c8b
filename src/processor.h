// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

// Processors run the stages: CpuProcessor (src/cpu/), CudaProcessor (src/cuda/). A processor implements launches,
// memory and transfers; StageEngine runs the pipeline on any of them. Work runs, or is queued, in the order of the
// calls, so that output of a stage is available to later ones, and released arrays can be reused at once.
//
//   ViewTypes                      view types of the stages (kernels/stage.h)
//   Keys                           keys of pixels, for the stages of kernels/init.h
//   Cubes                          image prepared for matching; `gray` is empty if there is none
//   Prepared                       image of a keyframe: cubes; colours and mask in the size of the depth map
//   kThreadsPerPriorCell           number of threads per prior cell
//   kMaskInColor                   whether the mask is stored in the colours
//   Planes                         array of planes and scores, as a map or in checkerboard order
//   Counts                         pixel counts of a stage
//
//   Queue                          FIFO of results in flight on all processors; its deliver(all) is Engine::deliver
//   ReadyEvent                     event: the work queued before mark() is done
//
//   number_of(context), number()   number of processors of an engine; index of this one
//   mark()                         ReadyEvent after all work so far
//   copy_from(array, count, home, made)        copy of another processor's array, which is complete from `made` on
//   synchronize()                  waits for pending copies and releases arrays of other processors
//   enter()                        guard that makes the device of the processor current
//   set_size(width, height)        of the depth maps; called first
//   limit_results_in_flight()      may deliver results; false once cancelled
//   grid()                         of the depth maps
//   array<T>(count), planes(), keys()          new arrays; keys are empty; planes have plane_numbers() elements
//   map(planes), to(planes)                    views of planes, for reading and writing; empty without planes
//   upload(values)                             array of a vector, for constant tables
//   prepare(keyframe, seconds)                 Prepared
//   gray(cubes), matchable(cubes), color(colors), mask(colors, mask)   views of it
//   bytes(cubes)                   memory of cubes
//   pack(cubes), packing(cubes), unpack(packed, packing)            cubes as one array, its layout, and back
//   landmarks(keyframe, lens)       landmarks for initial planes, and their number
//   planes_of_keys(source, planes)   view of the planes of keys, possibly stored in `planes`
//   launch(stage, counts)          runs a stage over all its pixels; `counts`: nullptr = none
//   splat(stage, count), start(pass), iterate(pass, colour, iteration, rescore), remove_duplicates(stage, candidates)
//                                  stages that do not run over all pixels in row order
//   timed(seconds, work)           runs `work` and adds the time of its launches
//   counted(seconds, work, then)   same with work(counts); calls then(numbers) when they are available
//   emit_depths, emit_points, emit_planes   queue results for callbacks
//   planes_of(plane_map)           planes of an emitted map
//   save(array, count, scratch, at), load<T>(count, scratch, at)   scratch file
namespace pmsp {

/// Layout of cubes in one array of 16-bit words.
struct CubePacking {
  std::size_t count = 0;   ///< words
  int side = 0;            ///< of the faces of the image [px]
  int matchable_side = 0;  ///< of the faces of the mask, which follow; 0 = none
};

/// Memory of a processor, reference-counted. Uninitialised.
template <class T>
using Array = std::shared_ptr<T[]>;

/// Keyframes that may still contain a duplicate, as bits of each open pixel in order or of all pixels, depending on the
/// processor. Empty before the first round.
struct DuplicateCandidates {
  Array<std::uint32_t> bits;
  std::size_t count = 0;
};

}  // namespace pmsp
