// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/report.h"

#include <cmath>
#include <utility>

#include "util/text.h"

namespace pmsp::eval {
namespace {

Json to_json(const std::vector<CloudScore>& scores) {
  Json list = Json::array();
  for (const CloudScore& score : scores) {
    list.push_back({{"threshold", score.threshold},
                    {"accuracy", score.accuracy},
                    {"accuracy_point", score.accuracy_point},
                    {"completeness", score.completeness},
                    {"completeness_visible", score.completeness_visible},
                    {"f", score.f()},
                    {"f_visible", score.f_visible()}});
  }
  return list;
}

Json to_json(const View& view) {
  Json json = {{"hit", view.hit}, {"hit_solid_angle", view.hit_solid_angle}};
  if (view.correct) {
    json["correct"] = view.correct->share;
    json["correct_solid_angle"] = view.correct->share_solid_angle;
    json["correct_of_hit"] = view.correct->of_hit;
    json["error_median_relative"] = view.correct->error_median;
  }
  return json;
}

/// "-" for NaN.
std::string figure(double value, const char* form) { return std::isnan(value) ? "-" : number_text(value, form); }

std::string score_lines(const std::vector<CloudScore>& scores, double factor, const char* unit) {
  std::string text;
  for (const CloudScore& s : scores) {
    const std::string threshold = format("%g %s", s.threshold * factor, unit);
    text += format("  %-10s %7.2f %%   %7.2f %%   %9s   %6.4f   %6s\n", threshold.c_str(), 100.0 * s.accuracy,
                   100.0 * s.completeness, figure(100.0 * s.completeness_visible, "%.2f %%").c_str(), s.f(),
                   figure(s.f_visible(), "%.4f").c_str());
  }
  return text;
}

DepthMeasures mean_of(const std::vector<KeyframeDepth>& maps) {
  std::vector<DepthMeasures> measures;
  measures.reserve(maps.size());
  for (const KeyframeDepth& map : maps) measures.push_back(map.measures);
  return eval::mean_of(measures);
}

LabelTable labels_of(const std::vector<KeyframeDepth>& maps) {
  LabelTable sum;
  for (const KeyframeDepth& map : maps) sum += map.labels;
  return sum;
}

std::string depth_line(const std::string& name, const DepthMeasures& m) {
  std::string line = format("  %-10s %7.2f", name.c_str(), 100.0 * m.valid);
  for (const auto& within : m.within) line += format("   %7.2f", 100.0 * within.share);
  return line + format("   %7.3f   %7.3f\n", 100.0 * m.error_median, 100.0 * m.error_p90);
}

Json to_json(const DepthFigures& figures) {
  Json json = Json::object();
  for (const DepthFigure& figure : kDepthFigures) json[figure.name] = figures.*figure.value;
  return json;
}

std::string figure_lines(const DepthMeasures& m, const std::string& scaling) {
  std::string text = "figures     of the pixels with an estimate, mean of the keyframes; " + scaling + "\n";
  text += "                AbsRel  SqRel [m]   RMSE [m]      log10     < 1.25   < 1.25^2   < 1.25^3\n";
  const auto rows = [&](std::size_t begin, std::size_t end) {
    for (const auto& [name, figures] : {std::pair{"plain", &m.plain}, std::pair{"solid angle", &m.solid_angle}}) {
      text += format("  %-11s", name);
      for (std::size_t i = begin; i < end; ++i) text += format(" %10.4f", figures->*kDepthFigures[i].value);
      text += "\n";
    }
  };
  rows(0, kRangeFigures);
  if (std::isnan(m.plain.normal_mean_deg)) return text;
  text += "  normals   mean [deg]     median    < 11.25     < 22.5       < 30\n";
  rows(kRangeFigures, kDepthFigures.size());
  return text;
}

Json to_json(const CalibrationBin& bin) {
  return {{"share", bin.share},
          {"confidence_min", bin.confidence_min},
          {"confidence_max", bin.confidence_max},
          {"error_expected_relative", bin.expected_error},
          {"error_median_relative", bin.error_median},
          {"error_p90_relative", bin.error_p90},
          {"within", bin.within}};
}

Json to_json(const CalibrationCurve& curve) {
  Json json = {{"deciles", Json::array()}};
  for (const CalibrationBin& bin : curve.deciles) json["deciles"].push_back(to_json(bin));
  const Monotone& m = curve.monotone;
  json["monotone"] = {
      {"median", m.median}, {"p90", m.p90}, {"within", m.within}, {"largest_rise_relative", m.largest_rise}};
  json["confident_half"] = to_json(curve.confident_half);
  return json;
}

std::string bin_figures(const CalibrationBin& bin) {
  return format("   %7.3f   %7.3f   %7.3f   %7.2f", 100.0 * bin.expected_error, 100.0 * bin.error_median,
                100.0 * bin.error_p90, 100.0 * bin.within);
}

std::string verdict(const char* name, const Monotone& m) {
  std::string text = format("  monotone %-14s median %s, p90 %s, share within %s", name, m.median ? "yes" : "NO",
                            m.p90 ? "yes" : "NO", m.within ? "yes" : "NO");
  if (m.largest_rise > 0.0) text += format("; an error rises by up to %.1f %% of itself", 100.0 * m.largest_rise);
  return text + "\n";
}

/// A line per label.
std::string rows_of(const LabelCounts& counts) {
  std::string text;
  for (const auto& [label, count] : counts.counts) {
    text += format("  %-14s  %8.3f %%\n", label_name(label).c_str(),
                   100.0 * static_cast<double>(count) / static_cast<double>(counts.points));
  }
  return text;
}

}  // namespace

Json to_json(const Alignment& a) {
  const Eigen::Matrix3d& r = a.truth_from_map.rotation;
  const Eigen::Vector3d& t = a.truth_from_map.translation;
  Json rows = Json::array();
  for (int i = 0; i < 3; ++i) rows.push_back({r(i, 0), r(i, 1), r(i, 2)});
  return {{"method", a.method},
          {"scale", a.truth_from_map.scale},
          {"rotation", rows},
          {"translation_m", {t.x(), t.y(), t.z()}},
          {"keyframes", a.truth_row.size()},
          {"matched", a.matched},
          {"shared_timestamps", a.shared_timestamps},
          {"position_rmse_m", a.position_rmse_m},
          {"position_max_m", a.position_max_m},
          {"rotation_median_deg", a.rotation_median_deg},
          {"rotation_max_deg", a.rotation_max_deg}};
}

Json to_json(const CloudMeasures& m) {
  return {{"points", m.points},
          {"surface_samples", m.surface_samples},
          {"error_median_m", m.error_median_m},
          {"error_p90_m", m.error_p90_m},
          {"error_median_point_m", m.error_median_point_m},
          {"error_p90_point_m", m.error_p90_point_m},
          {"error_median_relative", m.error_median_relative},
          {"error_p90_relative", m.error_p90_relative},
          {"relative", to_json(m.relative)},
          {"absolute_m", to_json(m.absolute)}};
}

Json to_json(const ViewMeasures& m) {
  Json json = to_json(m.mean);
  json["keyframes"] = m.views.size();
  json["keyframes_with_truth"] = m.with_truth;
  json["labels"] = to_json(m.mean.labels);
  json["per_keyframe"] = Json::array();
  for (const View& view : m.views) {
    Json entry = {{"id", view.keyframe_id}, {"timestamp", view.timestamp}};
    entry.update(to_json(view));
    json["per_keyframe"].push_back(entry);
  }
  return json;
}

Json to_json(const DepthMeasures& m) {
  Json json = {{"valid", m.valid}, {"valid_solid_angle", m.valid_solid_angle}};
  json["within"] = Json::array();
  for (const auto& within : m.within) {
    json["within"].push_back({{"threshold", within.threshold},
                              {"share", within.share},
                              {"share_solid_angle", within.share_solid_angle},
                              {"of_valid", within.of_valid}});
  }
  json["error_median_relative"] = m.error_median;
  json["error_p90_relative"] = m.error_p90;
  json["plain"] = to_json(m.plain);
  json["solid_angle"] = to_json(m.solid_angle);
  return json;
}

Json to_json(const std::vector<KeyframeDepth>& maps) {
  Json json = {{"keyframes", maps.size()}, {"mean", to_json(mean_of(maps))}, {"labels", to_json(labels_of(maps))}};
  json["per_keyframe"] = Json::array();
  for (const KeyframeDepth& map : maps) {
    Json entry = {{"id", map.keyframe_id}, {"width", map.width}, {"height", map.height}};
    entry.update(to_json(map.measures));
    json["per_keyframe"].push_back(entry);
  }
  return json;
}

Json to_json(const Calibration& c) {
  return {{"pixels", c.pixels},
          {"threshold", c.threshold},
          {"plain", to_json(c.plain)},
          {"solid_angle", to_json(c.solid_angle)}};
}

Json to_json(const LabelTable& labels) {
  Json json = Json::object();
  for (const auto& [label, m] : labels) {
    Json& entry = json[label_name(label)];
    entry = {{"share", m.pixels / labels.at(kAllLabels).pixels},
             {"missing", m.missing_share()},
             {"wrong", m.wrong_share()},
             {"behind_of_estimates", m.behind_share()},
             {"in_front_of_estimates", m.in_front_share()}};
    if (label == kThin) entry["grown"] = m.grown_share();
  }
  return json;
}

Json to_json(const LabelCounts& counts) {
  Json json = Json::object();
  for (const auto& [label, count] : counts.counts) {
    json[label_name(label)] = static_cast<double>(count) / static_cast<double>(counts.points);
  }
  return json;
}

std::string to_table(const Alignment& a) {
  if (a.method == "map is truth") {
    return format("alignment   none: the poses of the map are the truth, %zu keyframes\n", a.truth_row.size());
  }
  std::string text = format("alignment   by %s, %g m per map unit, %d of %zu keyframes matched\n", a.method.c_str(),
                            a.truth_from_map.scale, a.matched, a.truth_row.size()) +
                     format("            position %.4f m rms, %.4f m max; rotation %.3f deg median, %.3f deg max\n",
                            a.position_rmse_m, a.position_max_m, a.rotation_median_deg, a.rotation_max_deg);
  if (a.shared_timestamps > 0) {
    text += format("            %d keyframes have the timestamp of another one and were not matched\n",
                   a.shared_timestamps);
  }
  return text;
}

std::string to_table(const CloudMeasures& m) {
  return format("surface     %zu cloud points, %zu surface samples\n", m.points, m.surface_samples) +
         format("  error     median %.4f m, %.3f %% of the distance; 90th percentile %.4f m, %.3f %%\n",
                m.error_median_m, 100.0 * m.error_median_relative, m.error_p90_m, 100.0 * m.error_p90_relative) +
         "  within     accuracy   completeness  by visibility    F      F visible\n" +
         score_lines(m.relative, 100.0, "%") + score_lines(m.absolute, 100.0, "cm");
}

std::string to_table(const ViewMeasures& m, const ViewOptions& options) {
  std::string text = format("views       %zu keyframes, %d x %d, %d with truth\n", m.views.size(), 2 * options.height,
                            options.height, m.with_truth);
  text += "                          plain   by solid angle\n";
  text += format("  hit                %8.2f %%   %8.2f %%\n", 100.0 * m.mean.hit, 100.0 * m.mean.hit_solid_angle);
  if (!m.mean.correct) return text + "  no keyframe has a range map: correctness is unknown\n";
  const View::Correct& c = *m.mean.correct;
  text += format("  correct (%3g %%)    %8.2f %%   %8.2f %%\n", 100.0 * options.max_relative_error, 100.0 * c.share,
                 100.0 * c.share_solid_angle);
  text += format("  correct of hit     %8.2f %%\n", 100.0 * c.of_hit);
  text += format("  median error of hit %7.3f %%\n", 100.0 * c.error_median);
  return text + to_table(m.mean.labels, options.labels());
}

std::string to_table(const std::vector<KeyframeDepth>& maps, const std::string& scaling, const LabelOptions& options) {
  const DepthMeasures mean = mean_of(maps);
  std::string text =
      format("depth       %zu keyframes; all figures in %%, shares of the pixels with truth\n", maps.size());
  text += "  keyframe     valid";
  for (const auto& within : mean.within) text += format("   < %3g %% ", 100.0 * within.threshold);
  text += "   median       p90\n";
  for (const KeyframeDepth& map : maps) text += depth_line(std::to_string(map.keyframe_id), map.measures);
  text += depth_line("mean", mean);
  text += format("  solid angle%7.2f", 100.0 * mean.valid_solid_angle);
  for (const auto& within : mean.within) text += format("   %7.2f", 100.0 * within.share_solid_angle);
  text += "\n  of valid          ";
  for (const auto& within : mean.within) text += format("   %7.2f", 100.0 * within.of_valid);
  return text + "\n" + figure_lines(mean, scaling) + to_table(labels_of(maps), options);
}

std::string to_table(const Calibration& c) {
  std::string text = format("calibration %zu pixels by deciles of confidence; errors and shares in %%\n", c.pixels);
  text += "                                        plain                                   by solid angle\n";
  const std::string columns = format("  expected    median       p90   < %3g %%", 100.0 * c.threshold);
  text += "  decile   confidence " + columns + columns + "\n";
  for (std::size_t i = 0; i < c.plain.deciles.size(); ++i) {
    const CalibrationBin& bin = c.plain.deciles[i];
    text += format("  %6zu  %5.3f-%5.3f", i + 1, bin.confidence_min, bin.confidence_max) + bin_figures(bin) +
            bin_figures(c.solid_angle.deciles[i]) + "\n";
  }
  text += "  confident half     " + bin_figures(c.plain.confident_half) + bin_figures(c.solid_angle.confident_half);
  return text + "\n" + verdict("plain", c.plain.monotone) + verdict("by solid angle", c.solid_angle.monotone);
}

std::string to_table(const LabelTable& labels, const LabelOptions& options) {
  std::string text =
      format("labels      by solid angle, in %%; wrong: > %g %%; behind, in front: > %g %%, of the estimates\n",
             100.0 * options.max_relative_error, 100.0 * options.max_offset);
  text += "                     share    missing      wrong     behind   in front\n";
  for (const auto& [label, m] : labels) {
    text += format("  %-14s  %8.3f   %8.3f   %8.3f   %8.3f   %8.3f\n", label_name(label).c_str(),
                   100.0 * m.pixels / labels.at(kAllLabels).pixels, 100.0 * m.missing_share(), 100.0 * m.wrong_share(),
                   100.0 * m.behind_share(), 100.0 * m.in_front_share());
  }
  const auto thin = labels.find(kThin);
  if (thin == labels.end()) return text;
  return text +
         format("  thin grown      %8.3f %% of the pixels beside thin objects, by up to %d px, has their range\n",
                100.0 * thin->second.grown_share(), options.beside_px);
}

std::string table_of_behind(const LabelCounts& counts, const LabelOptions& options) {
  return format("behind      points more than %g %% behind the true surface from everywhere\n",
                100.0 * options.max_offset) +
         rows_of(counts);
}

std::string table_of_floating(const LabelCounts& counts) {
  return counts.counts.empty() ? "" : "floating    points in front of sky or movers\n" + rows_of(counts);
}

}  // namespace pmsp::eval
