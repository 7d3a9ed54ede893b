"""Craft as lists of named effects, and their hardware.

May import ``logs``, ``blocks`` and ``base``. ``effects/`` has a class for each physical cause (begin with
``base.py``, then ``drag.py``); ``models/model.py`` joins effects to a plant, ``models/blockmodel.py`` adds
them to any Block; ``hardware/`` has sensors, actuators, radio links and their calibration.
"""
