"""Messages of the simulator (Command, Operation, Frame), the native protocol and the AutoDRIVE devkit protocol."""
