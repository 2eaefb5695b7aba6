"""The paper's studies, flown again: Patnaik et al., \"Collision Recovery Control of a Foldable Quadrotor\"."""
