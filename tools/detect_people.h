#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "detect_sources.h"
#include "doppel/detect/blazepose/body_detector.h"
#include "doppel/detect/keypoints/keypoints.h"
#include "doppel/detect/keypoints/person_guide.h"

namespace doppel::tools {

/// The person whom the user names with --person. Nothing is set: nobody is named.
struct PersonWish {
  std::string camera;                     ///< whose pixel is meant
  std::optional<Eigen::Vector2d> pixel;   ///< near the hips
  std::optional<Eigen::Vector3d> near{};  ///< world, metres

  bool names_person() const { return pixel || near; }
};

/// Reads the words of --person: `X Y` for one camera, `CAMERA X Y`, or `X Y Z` in the world. A first word that is the
/// name of a camera is the camera, also if it is a number.
/// @param input the user's word for the sources @throws UsageError for anything else; says what is allowed
PersonWish read_person_wish(const std::vector<std::string>& words, std::span<const DetectSource> sources,
                            const std::string& input);

/// The moments of a sequence in which everybody is looked for, in all its cameras.
struct PeopleSearch {
  std::string sequence;
  std::vector<std::size_t> sources;  ///< [C] indices
  std::vector<long> rows;            ///< [F] of the motion, evenly spread
  long step = 1;                     ///< rows from one to the next
};

/// A search for each sequence of a capture with several cameras that have filmed at the same time: every 15th row, or
/// more often if these are fewer than 8.
std::vector<PeopleSearch> plan_searches(std::span<const DetectSource> sources);

/// Everybody in the images of one camera.
struct CameraPeople {
  cv::Size image;
  std::vector<People> people;  ///< [F] in the layout mediapipe33
};

/// Looks at everybody in the given rows. @param advance called after each row; returns false to stop
/// @return nothing when it was stopped
std::optional<CameraPeople> look_at_people(const DetectSource& source, const std::vector<long>& rows,
                                           BodyDetector& detector, const std::function<bool()>& advance);

/// Who is followed in a sequence.
struct FollowedPerson {
  std::vector<PersonGuide> guides;  ///< [C]
  nlohmann::ordered_json report;    ///< for detect.json; null where there are no several people
};

/// Chooses whom to follow, and logs it where there are several people. Without any person whom the cameras see besides
/// the one, the cameras need no guides.
/// @param seen [C]
/// @throws UsageError when the person who was named is not there
FollowedPerson choose_followed(const PeopleSearch& search, std::span<const DetectSource> sources,
                               const std::vector<CameraPeople>& seen, const PersonWish& wish);

}  // namespace doppel::tools
