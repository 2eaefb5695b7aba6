"""The paper's studies, flown again: one file a study, a table of its numbers beside ours, and the pictures.

Paper: Patnaik et al., "Collision Recovery Control of a Foldable Quadrotor".
"""
