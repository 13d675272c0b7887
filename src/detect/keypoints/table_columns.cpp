#include "doppel/detect/keypoints/table_columns.h"

#include <algorithm>

#include "doppel/core/as_size.h"
#include "doppel/detect/keypoints/csv_reader.h"

namespace doppel {

namespace {

/// The roles by the names of columns (plain_column). Of several names of a role, the first that a table has counts.
const std::array<std::vector<std::string>, kTableRoles>& names_of_roles() {
  static const std::array<std::vector<std::string>, kTableRoles> names{{
      {"frame", "frameid", "framenumber", "frameindex", "frameidx", "frameno", "framenum", "framenr", "fnum"},
      {"image", "imageid", "imagename", "imagefile", "file", "filename", "img", "imgname"},
      {"camera", "cam", "cameraname", "camname", "cameraid", "camid", "view"},
      {"person", "personid", "personindex", "personidx", "individual", "individuals", "trackid", "subject", "subjectid",
       "instance", "instanceid", "track"},
      {"name", "joint", "jointname", "keypoint", "keypointname", "bodypart", "bodyparts", "bodypartname", "landmark",
       "landmarkname", "point", "pointname", "part", "partname", "marker", "markername", "label"},
      {"jointid", "jointindex", "jointidx", "jointnumber", "keypointid", "keypointindex", "keypointidx",
       "keypointnumber", "landmarkid", "landmarkindex", "landmarkidx", "landmarknumber", "bodypartid", "pointid",
       "pointindex", "pointidx", "pointnumber"},
      {"x", "xpx", "xpixel", "xpixels", "pixelx", "xcoord", "xcoordinate", "xpos", "u"},
      {"y", "ypx", "ypixel", "ypixels", "pixely", "ycoord", "ycoordinate", "ypos", "v"},
      {"z", "zpx", "zcoord", "zcoordinate", "zpos"},
      {"confidence", "conf", "likelihood", "score", "visibility", "vis", "probability", "prob", "certainty", "presence",
       "c", "p", "v"},
  }};
  return names;
}

}  // namespace

TableColumns columns_of_table(const std::vector<std::string>& header) {
  TableColumns columns{};
  std::vector<std::string> plain;
  for (const std::string& name : header) plain.push_back(plain_column(name));
  for (std::size_t role = 0; role < columns.size(); ++role) {
    columns[role] = -1;
    for (const std::string& name : names_of_roles()[role]) {
      const auto found = std::find(plain.begin(), plain.end(), name);
      if (found == plain.end()) continue;
      columns[role] = static_cast<int>(found - plain.begin());
      found->clear();
      break;
    }
  }
  return columns;
}

}  // namespace doppel
