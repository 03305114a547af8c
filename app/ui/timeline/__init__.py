"""Widget that shows the lanes of `app.core.timeline`. It knows neither recordings nor other contents."""
