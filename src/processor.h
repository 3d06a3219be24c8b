// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

// A processor is what stages run on: CpuProcessor (src/cpu/), CudaProcessor (src/cuda/). It knows how a stage is
// launched, where arrays live and how results get to the host, and nothing of what stages compute; StageEngine runs the
// pipeline on any of them. Work is done, or queued, in the order of the calls, so that what a stage has written is
// there for those that follow, and an array that nobody holds any more may be used again at once.
//
//   Views                          types of the views that its stages take (kernels/stage.h)
//   Keys                           keys of pixels, for the stages of kernels/init.h
//   Cubes                          an image to be matched with; `gray` in it is empty where there is none
//   Prepared                       a keyframe's image: cubes, and of the depth map's pixels colours and mask
//   kPriorShares                   threads that share the work on a prior cell
//   kMaskInColor                   whether the mask lies in the colours
//   Planes                         an array of planes and scores, as a map or in checkerboard order
//   Counts                         numbers of pixels that a stage counts
//
//   Queue                          what was asked of an engine's processors; its deliver(all) is Engine::deliver
//   Mark                           a moment in a processor's work
//
//   number_of(context), number()   how many an engine has, and which one of them this is
//   mark()                         when all that was asked for up to now is done
//   bring(array, count, home, made)            a copy of an array of another processor, which is there from `made` on
//   settle()                       nothing of other processors' is needed any more
//   enter()                        called first in each piece of work; what it returns is kept until its end
//   set_size(width, height)        of the depth maps, before anything else
//   may_go_on()                    false after Densifier::cancel
//   grid()                         of the depth maps
//   array<T>(count), planes(), keys()          made, the latter without keys; planes have plane_numbers() elements
//   map(planes), to(planes)                    views of planes; a map's is empty where there are none
//   upload(values)                             of a vector, once for all
//   prepare(keyframe, seconds)                 the keyframe's image
//   gray(cubes), usable(cubes), color(colors), mask(colors, mask)   views of it
//   pack(cubes), packing(cubes), unpack(packed, packing)            cubes as one array, how they lie there, and back
//   landmarks(keyframe, lens)       the landmarks that make planes, and their number
//   first_planes(source, planes)   view of the planes that keys stand for; they may be put into `planes`
//   launch(stage, counts)          runs a stage over all its pixels; `counts`: nullptr = not wanted
//   splat(stage, count), start(pass), iterate(pass, colour, iteration, rescore), own(stage, asked)
//                                  those that do not go over all pixels alike
//   timed(seconds, work)           does what `work` launches, and adds the time that it takes
//   counted(seconds, work, then)   the same with work(counts); calls then(numbers) when they are known
//   emit_depths, emit_points, emit_planes   results on their way to a callback
//   planes_of(plane_map)           what was handed out so
//   save(array, count, scratch, at), load<T>(count, scratch, at)
namespace pmsp {

/// A keyframe's cubes in one array of 16-bit words.
struct CubePacking {
  std::size_t count = 0;  ///< words
  int side = 0;           ///< of the image's faces
  int usable_side = 0;    ///< of the mask's, which come behind; 0 = there is none
};

/// Memory of a processor, given back when nobody holds it any more. Uninitialised.
template <class T>
using Array = std::shared_ptr<T[]>;

/// Which keyframes each open pixel still has to ask in a round of ownership: of all open ones in order, or of all
/// pixels, as the processor likes it. None before the first round.
struct DuplicateCandidates {
  Array<std::uint32_t> bits;
  std::size_t count = 0;
};

}  // namespace pmsp
