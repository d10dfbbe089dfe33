"""Speed, accuracy and failure measurements, made through the engine's public face."""
