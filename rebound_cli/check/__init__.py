"""`rebound check`: a mission as it would be flown, in words and in a picture, and the schema for editors."""
