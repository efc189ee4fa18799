"""Drives of cars, simulated and real, in one form: commands and measured motion.

`read_drives` reads recordings, logs of AutoDRIVE's data recorder, tables (CSV with a header) and bags of ROS 1 and 2,
also compressed by gzip. The formats and options are in docs/identification.md.
"""

from autodrive.recording.drives.differentiation import local_parabola as local_parabola
from autodrive.recording.drives.drive import Drive as Drive
from autodrive.recording.drives.drive import LogProblem as LogProblem
from autodrive.recording.drives.options import LogOptions as LogOptions
from autodrive.recording.drives.reading import read_drives as read_drives
