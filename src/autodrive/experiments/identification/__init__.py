"""System identification: fits parameters of a vehicle's file to a recorded drive."""

from autodrive.experiments.identification.drive import IdentificationError as IdentificationError
from autodrive.experiments.identification.drive import read_drive as read_drive
from autodrive.experiments.identification.fit import identify as identify
from autodrive.experiments.identification.parameters import Free as Free
from autodrive.experiments.identification.parameters import VehicleFile as VehicleFile
from autodrive.experiments.identification.result import Fitted as Fitted
from autodrive.experiments.identification.result import Identification as Identification
from autodrive.recording.drives import Drive as Drive
