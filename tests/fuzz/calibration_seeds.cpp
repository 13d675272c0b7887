#include "fuzz/calibration_seeds.h"

#include <fmt/format.h>

#include "calibration/formats/binary_writers.h"
#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/core/atomic_file.h"
#include "fuzz/fuzz_target.h"
#include "support/ring_of_cameras.h"
#include "support/temporary_folder.h"

namespace doppel::fuzz {
namespace {

/// Two cameras in a format that the library writes.
CalibrationSeed seed_of_writer(const char* format, const std::vector<const char*>& names, bool is_folder) {
  const support::TemporaryFolder folder;
  std::vector<Camera> cameras;
  for (const PinholeCamera& camera : ring_of_cameras(2, 64, Eigen::Vector3d(0, 1, 0))) cameras.push_back(camera);
  cameras[0].name = "7";
  cameras[1].name = "left";
  const std::filesystem::path path = is_folder ? folder / "out" : folder / names[0];
  write_calibration(path, cameras, format);
  std::vector<std::string> files;
  for (const char* name : names) files.push_back(read_file(is_folder ? path / name : path));
  return {format, names, joined(files)};
}

std::string storage_matrix(const char* key, int rows, int cols, const char* data) {
  return fmt::format("{}: !!opencv-matrix\n   rows: {}\n   cols: {}\n   dt: d\n   data: [ {} ]\n", key, rows, cols,
                     data);
}

std::string stereo_yaml() {
  return "%YAML:1.0\n---\n" + storage_matrix("K1", 3, 3, "800., 0., 321.5, 0., 810., 242.25, 0., 0., 1.") +
         storage_matrix("D1", 1, 5, "0.1, -0.02, 0.001, -0.002, 0.005") +
         storage_matrix("K2", 3, 3, "700., 0., 300., 0., 710., 200., 0., 0., 1.") +
         storage_matrix("D2", 1, 4, "0.1, 0, 0, 0") + storage_matrix("R", 3, 3, "0, -1, 0, 1, 0, 0, 0, 0, 1") +
         "T: [ -60., 2., 3. ]\n";
}

std::string binary_colmap() {
  using namespace support;
  return joined({counted(2, binary_camera(1, 0, 640, 480, {500, 320, 240}) +
                                binary_camera(2, 4, 640, 480, {500, 510, 321, 241, -0.1, 0.02, 0.003, -0.004})),
                 counted(2, binary_image(1, "a.png", 2) + binary_image(2, "b.png"))});
}

constexpr const char* kStereoXml =
    R"(<?xml version="1.0"?><opencv_storage><image_width>640</image_width><image_height>480</image_height>
<camera_matrix type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt><data>8. 0. 3. 0. 8. 2. 0. 0. 1.</data>
</camera_matrix><distortion_coefficients type_id="opencv-matrix"><rows>4</rows><cols>1</cols><dt>d</dt>
<data>0.01 0.02 0.03 0.04</data></distortion_coefficients><sides>"a b" c</sides><list><_>1</_><_>2</_></list>
</opencv_storage>)";

/// The names of cv::stereoCalibrate's arguments, with left and right.
std::string stereo_sides() {
  return "%YAML:1.0\n---\n" +
         storage_matrix("camera_matrix_left", 3, 3, "800., 0., 321.5, 0., 810., 242.25, 0., 0., 1.") +
         storage_matrix("distCoeffsLeft", 1, 5, "0.1, -0.02, 0.001, -0.002, 0.005") +
         storage_matrix("cameraMatrix2", 3, 3, "700., 0., 300., 0., 710., 200., 0., 0., 1.") +
         storage_matrix("distR", 1, 4, "0.1, 0, 0, 0") +
         storage_matrix("rotation_matrix", 3, 3, "0, -1, 0, 1, 0, 0, 0, 0, 1") +
         "T: [ -60., 2., 3. ]\nimage_size: [ 640, 480 ]\n";
}

constexpr const char* kRosMessages =
    "header: \n  seq: 7\n  frame_id: \"cam\"\nheight: 480\nwidth: 752\ndistortion_model: \"plumb_bob\"\n"
    "D: [-0.28, 0.07, 0.0002, 0.00002, 0.0]\nK: [458.0, 0.0, 367.0, 0.0, 457.0, 248.0, 0.0, 0.0, 1.0]\n"
    "binning_x: 2\nbinning_y: 0\nroi: \n  x_offset: 4\n  height: 400\n  width: 700\n---\n"
    "header: \n  seq: 8\nheight: 480\nwidth: 752\ndistortion_model: \"plumb_bob\"\nD: [-0.28";

constexpr const char* kRos =
    "image_width: 640\nimage_height: 480\ncamera_name: front\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
    "  data: [800, 0, 321.5, 0, 810, 242.25, 0, 0, 1]\ndistortion_model: plumb_bob\ndistortion_coefficients:\n"
    "  rows: 1\n  cols: 5\n  data: [0.1, -0.02, 0.001, -0.002, 0.005]\nprojection_matrix:\n  rows: 3\n  cols: 4\n"
    "  data: [1, 0, 2, 0, 0, 1, 2, 0, 0, 0, 1, 0]\n";

constexpr const char* kKalibr =
    "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [0.1, -0.02, 0.001, -0.002]\n"
    "  distortion_model: radtan\n  intrinsics: [800, 810, 321.5, 242.25]\n  resolution: [640, 480]\n"
    "cam1:\n  T_cn_cnm1:\n  - [1.0, 0.0, 0.0, -0.1]\n  - [0.0, 1.0, 0.0, 0.0]\n  - [0.0, 0.0, 1.0, 0.0]\n"
    "  - [0.0, 0.0, 0.0, 1.0]\n  camera_model: pinhole\n  distortion_coeffs: [0.01, 0.02, 0.03, 0.04]\n"
    "  distortion_model: equidistant\n  intrinsics: [400, 410, 100, 90]\n  resolution: [200, 180]\n";

constexpr const char* kCaliscope =
    "[cameras.0]\ncam_id = 0\nrotation_count = -1\nignore = false\nsize = [640, 480]\n"
    "matrix = [[800.0, 0.0, 321.5], [0.0, 810.0, 242.25], [0.0, 0.0, 1.0]]\n"
    "distortions = [0.1, -0.02, 0.001, -0.002, 0.005]\ntranslation = [0.5, -0.25, 1.0]\n"
    "rotation = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]\n[cameras.3]\nport = 3\nsize = [200, 180]\n"
    "fisheye = true\nmatrix = [[400.0, 0.0, 100.0], [0.0, 410.0, 90.0], [0.0, 0.0, 1.0]]\n"
    "distortions = [0.01, 0.02, 0.03, 0.04]\ntranslation = [0.5, -0.25, 1.0]\nrotation = [0.0, 0.0, 1.5707963]\n";

constexpr const char* kPanoptic =
    R"({"calibDataSource":"made","cameras":[{"name":"00_01","type":"hd","resolution":[1920,1080],
"K":[[1500,0,950],[0,1510,530],[0,0,1]],"distCoef":[-0.2,0.1,0.01,0.02,0.03],"R":[[1,0,0],[0,1,0],[0,0,1]],
"t":[[0],[100],[400]]}]})";

constexpr const char* kShelf =
    R"({"0":{"R":[[0,-1,0],[0,0,-1],[1,0,0]],"T":[[-3000],[100],[1500]],"cx":510,"cy":380,"fx":1000,"fy":1010.5,
"k":[[-0.2],[0.1],[0.03]],"p":[[0.01],[0.02]]}})";

constexpr const char* kAist =
    R"([{"name":"c01","size":[1920,1080],"matrix":[[1500,0,950],[0,1510,530],[0,0,1]],
"rotation":[3.14159,0,0],"translation":[0,100,400],"distortions":[-0.2,0.1,0.01,0.02,0.03]}])";

constexpr const char* kHuman36m =
    R"({"extrinsics":{"S1":[{"orientation":[0.5,-0.5,0.5,-0.5],"translation":[-3000,100,1500]}]},
"intrinsics":[{"id":"a","center":[512,515],"focal_length":[1140,1150],"orientation":[0.5,-0.5,0.5,-0.5],
"radial_distortion":[-0.2,0.1,0.03],"tangential_distortion":[0.02,0.01],"res_h":1002,"res_w":1000,
"translation":[-3000,100,1500]}]})";

constexpr const char* kSplatting =
    R"([{"id":0,"img_name":"a","width":800,"height":601,"position":[1,2,3],
"rotation":[[0,0,1],[0,1,0],[-1,0,0]],"fx":700.0,"fy":710.0}])";

constexpr const char* kCaptury =
    "tc camera calibration v0.3\ncamera\t0\tAA:01\n\tserialNumber\t77\t# a comment\n\tframe\t0\n"
    "\t\tsensorSize\t4.8\t3.0\t# mm\n\t\tfocalLength\t6\n\t\tpixelAspect\t1.01\n\t\tcenterOffset\t0.024\t-0.048\n"
    "\t\tdistortionModel\tOpenCV\n\t\tdistortion\t-0.1\t0.02\t0.001\t-0.002\t0.003\n\t\torigin\t1000\t2000\t3000\n"
    "\t\tup\t0\t1\t0\n\t\tright\t1\t0\t0\n";

constexpr const char* kQualisys =
    R"(<?xml version="1.0"?><calibration type="regular"><cameras>
<camera active="1" serial="a7" model="Miqus Video" viewrotation="0"><fov_video left="10" top="20" right="1209" bottom="819"/>
<transform r11="1" r12="0" r13="0" r21="0" r22="1" r23="0" r31="0" r32="0" r33="1" x="500" y="1500" z="4000"/>
<intrinsic focallength="8" sensorMinU="0" sensorMaxU="81856" sensorMinV="0" sensorMaxV="65472" focalLengthU="64064" focalLengthV="64128" centerPointU="41600" centerPointV="32320" skew="0" radialDistortion1="-0.05" radialDistortion2="0.12" radialDistortion3="0.03" tangentalDistortion1="0.001" tangentalDistortion2="-0.002"/>
</camera></cameras></calibration>)";

constexpr const char* kVicon =
    R"(<?xml version="1.0" encoding="UTF-8" standalone="no" ?><Cameras VERSION="2.0">
<Camera DEVICEID="c0" DISPLAY_TYPE="VideoInputDevice:Any" PIXEL_ASPECT_RATIO="1" SENSOR_SIZE="1600 1200"><KeyFrames>
<KeyFrame FOCAL_LENGTH="1500.5" ORIENTATION="0.5 0.5 -0.5 0.5" POSITION="900 -2600 1200" PRINCIPAL_POINT="801.25 598.75" VICON_RADIAL2="Vicon3Parameter 1 2 0 0 0"/>
</KeyFrames></Camera></Cameras>)";

constexpr const char* kOptitrack =
    R"(<?xml version="1.0"?><calibrationProfile version="1"><Calibration><Cameras>
<Camera Serial="M1"><Properties CameraID="1"/><Attributes ImagerPixelWidth="1200" ImagerPixelHeight="1000"/>
<IntrinsicStandardCameraModel LensCenterX="610.5" LensCenterY="495.25" HorizontalFocalLength="1100" VerticalFocalLength="1105" k1="0.09" k2="-0.08" k3="0.002" TangentialX="0.0002" TangentialY="-0.0001"/>
<Extrinsic X="0.3" Y="1.2" Z="5" OrientMatrix0="1" OrientMatrix1="0" OrientMatrix2="0" OrientMatrix3="0" OrientMatrix4="1" OrientMatrix5="0" OrientMatrix6="0" OrientMatrix7="0" OrientMatrix8="1" /></Camera>
</Cameras></Calibration></calibrationProfile>)";

constexpr const char* kMetashape =
    R"(<?xml version="1.0" encoding="UTF-8"?><document version="2.0.0"><chunk label="a"><sensors>
<sensor id="3" label="s" type="frame"><resolution width="4000" height="3000"/>
<calibration type="frame" class="adjusted"><resolution width="4000" height="3000"/><f>3500</f><cx>12</cx><cy>-7</cy><b1>2</b1><b2>0.5</b2><k1>-0.1</k1><k2>0.02</k2><k3>0.003</k3><p1>0.001</p1><p2>-0.002</p2></calibration>
</sensor><sensor id="4" master_id="3" type="frame"><calibration class="adjusted"><resolution width="400" height="300"/><f>350</f></calibration>
<rotation>0 -1 0 1 0 0 0 0 1</rotation><location>2 0 3</location></sensor>
</sensors><components><component id="0"></component></components><cameras>
<camera id="0" sensor_id="3" component_id="0" label="left"><transform>1 0 0 1 0 0 1 2 0 -1 0 3 0 0 0 1</transform></camera>
<camera id="1" sensor_id="4" master_id="0" label="right"/>
</cameras><transform><rotation>0 -1 0 1 0 0 0 0 1</rotation><translation>10 20 30</translation><scale>2</scale></transform>
</chunk></document>)";

constexpr const char* kRealityCapture =
    R"(<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
<rdf:Description xcr:Version="3" xcr:Coordinates="absolute" xcr:DistortionModel="brown3t2" xcr:FocalLength35mm="27" xcr:Skew="0" xcr:AspectRatio="1" xcr:PrincipalPointU="0.01" xcr:PrincipalPointV="-0.02" xmlns:xcr="http://www.capturingreality.com/ns/xcr/1.1#">
<xcr:Rotation>1 0 0 0 0 -1 0 1 0</xcr:Rotation><xcr:Position>1 2 3</xcr:Position>
<xcr:DistortionCoeficients>-0.1 0.02 0.003 0 0.001 0.002</xcr:DistortionCoeficients>
</rdf:Description></rdf:RDF></x:xmpmeta>)";

constexpr const char* kActorsHq =
    "name,w,h,rx,ry,rz,tx,ty,tz,fx,fy,px,py\n"
    "Cam001,4000,3000,0,1.57,0,1,2,3,2,2.5,0.5,0.25\n";

}  // namespace

std::vector<CalibrationSeed> calibration_seeds() {
  return {seed_of_writer("skeletool", {"a.calibration"}, false),
          seed_of_writer("opencv", {"a.yml"}, false),
          seed_of_writer("opencv", {"a.xml"}, false),
          seed_of_writer("opencv", {"a.json"}, false),
          seed_of_writer("toml", {"a.toml"}, false),
          seed_of_writer("nerfstudio", {"transforms.json"}, false),
          seed_of_writer("colmap", {"cameras.txt", "images.txt"}, true),
          {"colmap", {"cameras.bin", "images.bin"}, binary_colmap()},
          seed_of_writer("easymocap", {"intri.yml", "extri.yml"}, true),
          {"opencv_stereo", {"calibration.yml"}, stereo_yaml()},
          {"opencv_stereo", {"calibration.xml"}, kStereoXml},
          {"ros_camera_info", {"camera.yaml"}, kRos},
          {"kalibr", {"camchain.yaml"}, kKalibr},
          {"caliscope", {"camera_array.toml"}, kCaliscope},
          {"panoptic", {"a.json"}, kPanoptic},
          {"shelf", {"a.json"}, kShelf},
          {"aist", {"a.json"}, kAist},
          {"human36m", {"a.json"}, kHuman36m},
          {"gaussian_splatting", {"cameras.json"}, kSplatting},
          {"captury", {"a.calib"}, kCaptury},
          {"actorshq", {"calibration.csv"}, kActorsHq},
          {"qualisys", {"a.xml"}, kQualisys},
          {"vicon", {"a.xcp"}, kVicon},
          {"optitrack", {"a.xml"}, kOptitrack},
          {"metashape", {"a.xml"}, kMetashape},
          {"realitycapture", {"a.xmp"}, kRealityCapture},
          {"opencap", {"a.pickle"}, support::opencap_dict(support::opencap_pose())},
          {"zju", {"annots.npy"}, support::npy_of_objects(support::two_zju_cameras())},
          {"opencv_stereo", {"sides.yml"}, stereo_sides()},
          {"ros_camera_info", {"messages.yaml"}, kRosMessages}};
}

}  // namespace doppel::fuzz
