use kriging::{Error, FitOptions, Kernel, fit};

use crate::common::{self, Sample, written};

#[test]
fn a_model_read_back_predicts_the_same_bits() {
    for kernel in Kernel::ALL {
        let mut sample = Sample::smooth(50, 3, 0.01);
        // A coordinate that the model ignores, whose range is infinite.
        sample.x.chunks_mut(3).for_each(|x| x[1] = 0.3);
        let options = FitOptions {
            kernel,
            ..FitOptions::default()
        };
        let model = fit(&sample.data(), &options).unwrap();
        let text = written(model.clone());
        let read = common::read(&text).unwrap();
        for x in Sample::smooth(40, 3, 0.0).x.chunks(3) {
            assert_eq!(read.mean(x).to_bits(), model.mean(x).to_bits());
            assert_eq!(read.predict(x), model.predict(x));
        }
        assert_eq!(read.parameters(), model.parameters());
        assert_eq!(read.warnings(), model.warnings());
        assert_eq!(read.leave_one_out(), model.leave_one_out());
        assert_eq!(
            read.negative_log_likelihood(),
            model.negative_log_likelihood()
        );
        assert_eq!(written(read), text);
    }
}

#[test]
fn damaged_models_are_refused() {
    let sample = Sample::smooth(5, 1, 0.01);
    let text = written(fit(&sample.data(), &FitOptions::default()).unwrap());
    let read = |text: &str| common::read(text).unwrap_err();
    let edited = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
        change(&mut value);
        read(&value.to_string())
    };
    assert!(matches!(read("not json"), Error::Json(_)));
    assert!(matches!(read(&text[..text.len() / 2]), Error::Json(_)));
    assert!(matches!(
        edited(&|v| v["version"] = 2.into()),
        Error::Version {
            found: 2,
            supported: 1
        }
    ));
    assert!(matches!(
        edited(&|v| v["surprise"] = 1.into()),
        Error::Json(_)
    ));
    assert!(matches!(
        edited(&|v| v["weights"] = vec![1.0].into()),
        Error::Shape {
            what: "weights",
            expected: 5,
            got: 1
        }
    ));
    assert!(matches!(
        edited(&|v| v["dimensions"] = u64::MAX.into()),
        Error::Shape { .. }
    ));
    assert!(matches!(
        edited(&|v| v["sigma2"] = (-1.0).into()),
        Error::OutOfRange { what: "sigma2", .. }
    ));
    assert!(matches!(
        edited(&|v| v["ranges"] = vec![0.0].into()),
        Error::OutOfRange { what: "ranges", .. }
    ));
    assert!(matches!(
        edited(&|v| v["ranges"] = vec![1e-320].into()),
        Error::Extent { what: "x" }
    ));
    assert!(matches!(
        edited(&|v| v["noise_variance"][2] = (-1.0).into()),
        Error::NegativeNoise { index: 2, .. }
    ));
}

#[test]
fn a_stored_model_without_a_factor_still_has_variances() {
    // Noise vastly above the process: the factor must not be refused for its scale.
    let sample = Sample::smooth(5, 1, 0.01);
    let text = written(fit(&sample.data(), &FitOptions::default()).unwrap());
    let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
    value["sigma2"] = 1e-320.into();
    value["noise_variance"] = vec![1.0, 0.0, 1.0, 0.0, 1.0].into();
    let model = common::read(&value.to_string()).unwrap();
    assert!(model.predict(&[0.5]).variance.is_finite());
}
