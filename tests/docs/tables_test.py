"""scripts/tables.py fills the figures of an evaluation, a tracking and an adaptation into a table."""
import json
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

TABLES = Path(__file__).resolve().parents[2] / "scripts/tables.py"


def evaluation(iou):
    """An evaluation as `doppel evaluate --json` prints it; the protocol names the method too."""
    row = {"AMVIoU": iou, "cameras": {"0": 0.5, "1": {"MSE": 7.0}}}
    return {"protocol": {"steps": {"egnet": 300}}, "splits": {"test": {"skinning": {"AMVIoU": 0.8}, "egnet": row}}}


class Tables(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        for seed, iou in (("1", 0.91), ("2", 0.95)):
            self.write(f"run-{seed}.json", evaluation(iou))

    def write(self, name, content):
        Path(self.folder.name, name).write_text(json.dumps(content))

    def filled(self, text, seeds=("1", "2")):
        found = subprocess.run([sys.executable, str(TABLES), self.folder.name, *seeds], input=text, text=True,
                               capture_output=True)
        return found.stdout if found.returncode == 0 else found.stderr

    def test_figures_of_methods(self):
        self.assertEqual(self.filled("| {run-1.json egnet AMVIoU 4} | {run-1.json skinning AMVIoU 2} |\n"),
                         "| 0.9100 | 0.80 |\n")

    def test_spread_over_seeds_and_means(self):
        self.assertEqual(self.filled("{run-@.json egnet AMVIoU 3}"), "0.930 ± 0.020")
        self.assertEqual(self.filled("{run-@.json egnet AMVIoU 3}", seeds=["2"]), "0.950")
        self.assertEqual(self.filled("{run-[1,2].json egnet AMVIoU 3}"), "0.930")

    def test_figures_of_single_cameras_are_left_out(self):
        self.assertEqual(self.filled("|{run-1.json egnet MSE 1}|"), "||")

    def test_the_sequence_and_not_its_frames(self):
        frames = [{"keypoint_error_px": 9.0}, {"keypoint_error_px": 8.0}]
        self.write("track.json", {"sequences": {"walk": {"per_frame": frames, "lost_frames": [4, 5, 6],
                                                         "livecap": {"IoU": 0.75}, "keypoint_error_px": 1.5}}})
        self.assertEqual(self.filled("{track.json keypoint_error_px 1} {track.json IoU 2} {track.json lost_frames 0}"),
                         "1.5 0.75 3")

    def test_names_with_spaces(self):
        self.write("adapt.json", {"protocol": {"frames": {"held out, before": 4}},
                                  "splits": {"held out, before": {"posenet": {"AMVIoU": 0.5}},
                                             "held out, after": {"posenet": {"AMVIoU": 0.6}}}})
        self.assertEqual(self.filled("{adapt.json 'held out, after' posenet AMVIoU 1}"), "0.6")

    def test_a_missing_file_is_named(self):
        self.assertIn("run-3.json", self.filled("{run-@.json egnet AMVIoU 3}", seeds=["1", "3"]))


if __name__ == "__main__":
    unittest.main()
