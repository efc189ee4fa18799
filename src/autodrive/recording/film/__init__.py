"""Films of a recording: any scene camera or sensor camera, in video files whose codecs everybody may use."""

from autodrive.recording.film.film import FilmOptions, film

__all__ = ["FilmOptions", "film"]
