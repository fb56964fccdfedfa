"""The jobs: options in, a result out. One module a job."""
