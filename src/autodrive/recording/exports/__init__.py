"""Exports of recordings to the formats of other programs, and recorded drives of AutoDRIVE's data recorder."""

from autodrive.recording.exports.formats import FORMATS as FORMATS
from autodrive.recording.exports.formats import default_path as default_path
from autodrive.recording.exports.formats import export as export
