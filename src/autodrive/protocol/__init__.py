"""What goes in and out: commands, requests, frames; and the AutoDRIVE devkit's dictionary of them."""
