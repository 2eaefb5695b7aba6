"""The vehicle's inner loops as the paper has them: attitude (eqs. 4-5) and position (eq. 6); and what they fly."""
