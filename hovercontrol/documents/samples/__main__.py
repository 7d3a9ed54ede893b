"""Write the sample log that the package ships."""

from hovercontrol.documents.samples import make_sample, sample_path

if __name__ == "__main__":
    make_sample().save(sample_path())
    print(f"wrote {sample_path()}")
