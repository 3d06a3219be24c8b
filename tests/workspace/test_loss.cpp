// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <map>
#include <string>

#include "workspace/loss.h"

using namespace pmsp;
using namespace pmsp::workspace;
using Catch::Contains;

namespace {

constexpr int kKeyframes = 40;

StepInputs some_inputs() {
  StepInputs inputs;
  inputs.options_json =
      R"({"width":640,"seed":1,"lens_distance":0.0,"patchmatch":{"iterations":3},"fusion":{"window":7}})";
  inputs.planes_options_json = R"({"width":640,"seed":1,"lens_distance":0.0,"patchmatch":{"iterations":3}})";
  inputs.engine = "this machine";
  inputs.mask = "m";
  return inputs;
}

std::map<std::int64_t, std::string> some_images(int first = 0, int last = kKeyframes) {
  std::map<std::int64_t, std::string> images;
  for (int i = first; i < last; ++i) images[3 * i] = "image " + std::to_string(i);
  return images;
}

/// The record of a finished step with these inputs: each keyframe has planes.
Record record_with(const StepInputs& inputs, const std::map<std::int64_t, std::string>& images) {
  StepInputs of_record = inputs;
  for (const auto& [id, image] : images) {
    StepKeyframe keyframe;
    keyframe.keyframe.id = id;
    keyframe.image = image;
    of_record.keyframes.push_back(keyframe);
  }
  return record_of_begun("s", of_record);
}

void replace(std::string& text, const std::string& what, const std::string& with) {
  text.replace(text.find(what), what.size(), with);
}

StepInputs inputs_with(const std::string& what, const std::string& with) {
  StepInputs inputs = some_inputs();
  for (std::string* text : {&inputs.options_json, &inputs.planes_options_json}) replace(*text, what, with);
  return inputs;
}

}  // namespace

TEST_CASE("a mission that grows or moves or loses keyframes or images keeps its results") {
  const StepInputs inputs = some_inputs();
  const Record record = record_with(inputs, some_images(0, 20));
  for (const auto& images : {some_images(0, 20), some_images(0, 40), some_images(0, 1), some_images(13, 15)}) {
    const Loss loss = loss_of(record, inputs, images);
    CHECK_FALSE(loss.is_other_mission);
    CHECK_FALSE(loss.is_nearly_all);
    CHECK(loss.planes == 20);
    CHECK(loss.kept == loss.same);
  }
  std::map<std::int64_t, std::string> some_changed = some_images(0, 20);
  for (int i = 0; i < 17; ++i) some_changed[3 * i] = "other";
  CHECK_FALSE(loss_of(record, inputs, some_changed).is_other_mission);
  CHECK_FALSE(loss_of(record, inputs, some_changed).is_nearly_all);
}

TEST_CASE("another mission has other images for the same ids or the images for other ids") {
  const StepInputs inputs = some_inputs();
  const Record record = record_with(inputs, some_images());
  std::map<std::int64_t, std::string> others = some_images(), renumbered;
  for (auto& [id, image] : others) image += " of another flight";
  CHECK(loss_of(record, inputs, others).is_other_mission);
  others[0] = "image 0";  // a test image, say
  CHECK(loss_of(record, inputs, others).is_other_mission);
  for (const auto& [id, image] : some_images()) renumbered[id + 1] = image;
  CHECK(loss_of(record, inputs, renumbered).is_other_mission);
  CHECK(loss_of(record, inputs, some_images(kKeyframes, 60)).is_other_mission);
}

TEST_CASE("options or engine or mask that invalidate all results are a named loss") {
  const Record record = record_with(some_inputs(), some_images());
  const auto loss = [&](const StepInputs& inputs) { return loss_of(record, inputs, some_images()); };
  CHECK(loss(inputs_with("640", "64")).is_nearly_all);
  CHECK(loss(inputs_with("640", "64")).kept == 0);
  CHECK(loss(inputs_with("640", "64")).difference == "width 640 -> 64");
  CHECK(loss(inputs_with("\"iterations\":3", "\"iterations\":5")).difference == "patchmatch.iterations 3 -> 5");
  StepInputs inputs = some_inputs();
  inputs.engine = "that machine";
  CHECK(loss(inputs).difference == "engine \"this machine\" -> \"that machine\"");
  inputs = some_inputs();
  inputs.mask = "n";
  CHECK_THAT(loss(inputs).difference, Contains("mask"));
  std::map<std::int64_t, std::string> masked = some_images();
  for (auto& [id, image] : masked) image += ", mask x";
  CHECK_FALSE(loss_of(record, some_inputs(), masked).is_other_mission);
  CHECK(loss_of(record, some_inputs(), masked).is_nearly_all);
  masked = some_images();
  for (int i = 0; i < kKeyframes / 2; ++i) masked[3 * i] += ", mask x";  // the others are kept
  CHECK_FALSE(loss_of(record, some_inputs(), masked).is_nearly_all);
}

TEST_CASE("changes that keep planes or follow from a growing mission are no loss") {
  const Record record = record_with(some_inputs(), some_images());
  StepInputs inputs = some_inputs();
  replace(inputs.options_json, "\"window\":7", "\"window\":5");
  CHECK_FALSE(loss_of(record, inputs, some_images()).is_nearly_all);
  CHECK_FALSE(
      loss_of(record, inputs_with("\"lens_distance\":0.0", "\"lens_distance\":0.1"), some_images()).is_nearly_all);
  CHECK_FALSE(loss_of({}, some_inputs(), some_images()).is_nearly_all);
  CHECK_FALSE(loss_of({}, some_inputs(), some_images()).is_other_mission);
}
