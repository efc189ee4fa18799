"""One run of the simulator: options, worlds, page server and devkit bridge, summary.

    from autodrive.run import RunOptions, simulate

    summary = simulate(RunOptions("mini_map", duration=5.0, speed=None, has_page=False))
    print(summary.real_time_factor)

Names are imported when they are first used, so that `import autodrive.run` is light.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
