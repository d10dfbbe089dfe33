"""The accuracy laboratory: reference problems, and what each method's error costs on them."""
