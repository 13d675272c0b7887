#include "doppel/detect/blazepose/model_files.h"

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {

const Package kModelPackage = {"@mediapipe/pose@0.5.1675469404",
                               {kLandmarkFiles[0], kLandmarkFiles[1], kLandmarkFiles[2], kDetectorFile}};

std::string to_string(BlazePoseModel model) {
  return model == BlazePoseModel::lite ? "lite" : model == BlazePoseModel::full ? "full" : "heavy";
}

BlazePoseModel parse_blazepose_model(const std::string& word) {
  for (const BlazePoseModel model : {BlazePoseModel::lite, BlazePoseModel::full, BlazePoseModel::heavy})
    if (to_string(model) == word) return model;
  fail<UsageError>("the model of BlazePose is \"{}\"; expected lite, full or heavy", word);
}

const PackageFile& landmark_file(BlazePoseModel model) { return kLandmarkFiles.at(as_size(model)); }

}  // namespace doppel
