"""System identification: fits parameters of a vehicle's file to a recorded drive."""

from autodrive.identification.drive import Drive as Drive
from autodrive.identification.drive import IdentificationError as IdentificationError
from autodrive.identification.drive import read_drive as read_drive
from autodrive.identification.fit import identify as identify
from autodrive.identification.parameters import Free as Free
from autodrive.identification.parameters import VehicleFile as VehicleFile
from autodrive.identification.result import Fitted as Fitted
from autodrive.identification.result import Identification as Identification
