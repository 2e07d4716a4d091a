"""The main job: models side by side under the same disturbances and delays.

`spec` says what is run, `cells` runs it, `scores` ranks, `theory` puts exact theory beside it, `guidance` says it in
words.
"""
